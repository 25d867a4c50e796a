"""Import of OmniGibson scene folders, for those who own the BEHAVIOR-1K data set."""
