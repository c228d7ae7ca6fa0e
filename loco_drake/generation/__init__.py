"""Motion as tokens: features, tokenizer (VQ-VAE) and generator (GPT)."""
