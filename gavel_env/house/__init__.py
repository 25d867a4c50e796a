"""The house: scenes, the map that the robot drives on, and its compiled kernels."""
