#version 330 core
in float away;
out float depth;

void main() {
    depth = away;
}
