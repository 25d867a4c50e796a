"""Commands of the command line, one module per family; see `eval.cli`."""
