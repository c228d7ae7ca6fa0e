"""Motion of animals and robots: keypoints, gaits, rhythm, files and their quality."""
