"""From keypoints of an animal to motion of a robot."""
