"""The paper, figure by figure: studies to run, figures to draw, claims to judge."""
