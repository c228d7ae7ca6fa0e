"""What training computes without a diagram: plan, observation, action, reward."""
