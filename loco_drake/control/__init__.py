"""Control without a diagram: plan, re-timing, observation, action, reward, actor."""
