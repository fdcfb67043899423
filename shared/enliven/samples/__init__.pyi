from .shipped import cactus_project, load_sample

__all__ = ["cactus_project", "load_sample"]
