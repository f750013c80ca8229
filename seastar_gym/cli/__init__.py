"""The command `seastar`.

In come words of a shell; out go exit codes, files, and one sentence for what cannot be. Every subcommand is a function
of a module that is imported when it is asked for: help is there at once, and extras are needed by their commands alone.
"""
