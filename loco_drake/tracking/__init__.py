"""The Gymnasium environment and the training of the tracking policy."""
