"""The Gymnasium environments, their spaces and their wrappers."""
