"""The run spec: TOML models, parsing, sweeps, JSON Schema."""
