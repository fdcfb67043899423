from .write import USD as USD, write_usd as write_usd
