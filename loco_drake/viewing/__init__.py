"""Motion to look at without physics: in Meshcat, on a saved page and as a video."""
