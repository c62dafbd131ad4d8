"""`python -m r2s2r_cli` is `r2s2r`."""

from r2s2r_cli.app import main

main()
