from .shipped import cactus_project as cactus_project, load_sample as load_sample
