// Corners of a shape, or of its shadow on the floor.
ATTRIBUTE vec3 corner, normal;
uniform mat4 view, place;
uniform vec3 sun;
uniform int kind;
PASSED_ON vec3 at, n;
void main() {
  vec4 world = place * vec4(corner, 1.0);
  n = mat3(place[0].xyz, place[1].xyz, place[2].xyz) * normal;
  if (kind == SHADOW) world.xyz -= sun * ((world.z - 0.004) / sun.z);
  at = world.xyz;
  gl_Position = view * world;
}
