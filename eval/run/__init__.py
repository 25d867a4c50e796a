"""Running agents through environments: contestants, workers, one record per episode."""
