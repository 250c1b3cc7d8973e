"""gfmd: elastic contact of rough surfaces, for bodies of any stiffness k(q)."""

__version__ = "0.1.0"
