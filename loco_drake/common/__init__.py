"""What has nothing to do with robots: errors, files, processes, weights, rotations."""
