"""Takes, and how they drive a skeleton: rotations along arc length, layered and never baked (AniMesh, 5).

What a document keeps: a take (clip), a layer that refers to it and the spans of a bone (layers), a pinned
foot (contacts). Where takes come from: capture_clip, recorded, positions. Edits: retarget, copying, pin; what
they are made with: basis. Playing: evaluate, whose player samples (timing, polyline, sampling), multiplies
(compose), goes along (travel), reaches (end_effector, reaching, ik) and stands (standing).
"""
