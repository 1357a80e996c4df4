"""What `stiffdice` does, a module a command: `add` tells argparse of it, and names the function that does it.

Modules import what they need only when their command is called, so that --help is quick.
"""
