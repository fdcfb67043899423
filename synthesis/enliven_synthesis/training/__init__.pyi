from .dataset import Dataset as Dataset, render_dataset as render_dataset
