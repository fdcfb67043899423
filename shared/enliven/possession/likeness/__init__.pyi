from .finding import find_body_in_mesh as find_body_in_mesh, find_person_in_mesh as find_person_in_mesh
from .skeleton import BodyInMesh as BodyInMesh
