"""Loads shader programs from the files in ``shaders/``. Resolves includes, uniform blocks and
texture units.
"""

from __future__ import annotations

import re
from importlib import resources

import moderngl

_INCLUDE = re.compile(r'^#include "([a-z_.]+)"$', re.MULTILINE)
BLOCK_BINDINGS = {"Frame": 0, "Bones": 1}
"""Binding point of each uniform block, the same in every program."""
TEXTURE_UNITS = {
    "shadow_map": 0,
    "contact_map": 1,
    "transforms": 2,
    "source": 3,
    "picture": 3,
    "base_map": 4,
    "finish_map": 5,
    "normal_map": 6,
    "occlusion_map": 7,
    "emissive_map": 8,
    "held": 9,
}
"""Texture unit of each sampler. Samplers that no program uses together share one."""


def read_shader_source(name: str, defines: tuple[str, ...] = ()) -> str:
    """Returns the source of one shader file. ``#version`` is moved to the top, before any comments.

    Args:
        defines: names for ``#ifdef``. Defines are used instead of uniforms, because a software renderer would
            execute both branches.
    """
    text = (resources.files("enliven_viewer.render") / "shaders" / name).read_text(encoding="utf-8")
    text = _INCLUDE.sub(lambda match: read_shader_source(match.group(1)), text)
    if "#version 330 core\n" in text:
        head = "#version 330 core\n" + "".join(f"#define {name}\n" for name in defines)
        text = head + text.replace("#version 330 core\n", "", 1)
    return text


def load_program(
    ctx: moderngl.Context,
    vertex: str,
    fragment: str | None = None,
    varyings: tuple[str, ...] = (),
    defines: tuple[str, ...] = (),
) -> moderngl.Program:
    """Returns a program of two shader files. Without a fragment shader, the outputs ``varyings`` are captured
    (transform feedback).
    """
    program = ctx.program(
        vertex_shader=read_shader_source(vertex, defines),
        fragment_shader=read_shader_source(fragment, defines) if fragment else None,
        varyings=varyings,
    )
    for name in program:
        member = program[name]
        if isinstance(member, moderngl.UniformBlock):
            member.binding = BLOCK_BINDINGS[name]
        elif isinstance(member, moderngl.Uniform) and name in TEXTURE_UNITS:
            member.value = TEXTURE_UNITS[name]
    return program


def set_uniform(program: moderngl.Program, name: str, value: object) -> None:
    """Sets a uniform. Does nothing if the compiler has removed it because it is unused."""
    if name in program:
        program[name] = value
