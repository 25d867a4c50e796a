"""Evaluation: steps agents through environments; owns records, tables, figures, reports and the command line."""
