"""The robots, ready for Drake, and the pretrained weights."""
