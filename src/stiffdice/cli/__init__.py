"""The command `stiffdice`, one module per subcommand."""
