"""The command `seastar`: every subcommand is a module with `main(arguments)`, imported when it is asked for."""
