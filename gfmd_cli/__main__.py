"""`python -m gfmd_cli`."""

from gfmd_cli.cli import main

main()
