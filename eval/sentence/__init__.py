"""One sentence in one house: understood, staged, planned, driven, and shown (`gavel run`, `eval.run_sentence`)."""
