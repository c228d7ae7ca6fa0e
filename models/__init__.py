"""Robot models for Drake, and the pretrained weights."""
