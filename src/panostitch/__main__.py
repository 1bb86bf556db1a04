"""`python -m panostitch`."""

from panostitch.cli.main import main

main()
