//! The shaders, in GLSL ES 3.00.

/// The vertex shader of the arm. It computes the light: in software rendering, corners are fewer and cheaper than pixels.
pub const ARM_VERTEX: &str = r"#version 300 es
uniform mat4 view_projection;
uniform mat4 bodies[11];
// Colour of each body's accent; the last part is its weight in the body's shell.
uniform vec4 accents[11];
// The weight of the highlight's colour in each body.
uniform float highlights[11];
uniform vec3 shell;
uniform vec3 dark;
uniform vec3 highlight;
// One colour instead of all: weight in the last part.
uniform vec4 tint;
// How much light changes a colour, 0 to 1.
uniform float shading;
in vec3 position;
in vec3 normal;
// Number of the body, and finish: 0 shell, 1 dark, 2 accent.
in vec2 kind;
out vec3 colour;
void main() {
    int body = int(kind.x + 0.5);
    vec3 direction = mat3(bodies[body]) * normal;
    float key = max(dot(direction, normalize(vec3(0.55, 0.35, 0.95))), 0.0);
    float fill = max(dot(direction, normalize(vec3(-0.6, 0.5, 0.2))), 0.0);
    float light = mix(1.0, 0.52 + 0.44 * key + 0.12 * fill, shading);
    vec4 accent = accents[body];
    vec3 own = kind.y < 0.5 ? mix(shell, accent.rgb, accent.a) : dark;
    own = kind.y < 1.5 ? mix(own, highlight, highlights[body]) : accent.rgb;
    colour = mix(own, tint.rgb, tint.a) * light;
    gl_Position = view_projection * (bodies[body] * vec4(position, 1.0));
}
";

/// The fragment shader of the arm, with premultiplied opacity.
pub const ARM_FRAGMENT: &str = r"#version 300 es
precision mediump float;
uniform float opacity;
in vec3 colour;
out vec4 pixel;
void main() {
    pixel = vec4(colour * opacity, opacity);
}
";

/// The vertex shader of lines and of triangles without lighting.
pub const LINE_VERTEX: &str = r"#version 300 es
uniform mat4 view_projection;
in vec3 position;
in vec4 colour;
out vec4 blended;
void main() {
    blended = vec4(colour.rgb * colour.a, colour.a);
    gl_Position = view_projection * vec4(position, 1.0);
}
";

/// The fragment shader of lines and of triangles without lighting.
pub const LINE_FRAGMENT: &str = r"#version 300 es
precision mediump float;
in vec4 blended;
out vec4 pixel;
void main() {
    pixel = blended;
}
";

/// The vertex shader of a marker: a square of rendered pixels around a position.
pub const MARKER_VERTEX: &str = r"#version 300 es
uniform mat4 view_projection;
uniform float size;
in vec3 position;
in vec4 colour;
out vec3 inside;
void main() {
    inside = colour.rgb;
    gl_PointSize = size;
    gl_Position = view_projection * vec4(position, 1.0);
}
";

/// The fragment shader of a marker: a disc with a rim, or a ring if `hollow` is above 0.
pub const MARKER_FRAGMENT: &str = r"#version 300 es
precision mediump float;
uniform float hollow;
uniform vec3 rim;
in vec3 inside;
out vec4 pixel;
void main() {
    float radius = length(gl_PointCoord - 0.5) * 2.0;
    if (radius > 1.0 || (hollow > 0.0 && radius < 0.55)) discard;
    pixel = vec4(hollow > 0.0 || radius < 0.72 ? inside : rim, 1.0);
}
";
