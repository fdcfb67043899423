from .dataset import Dataset, render_dataset

__all__ = ["Dataset", "render_dataset"]
