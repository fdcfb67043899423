"""Where the sensors of a space stand: rigid transforms, and the TOML file that keeps them."""
