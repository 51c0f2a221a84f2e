// Light on floor, glass and solid shapes; the edges of floor and paths are averaged over a pixel.
PASSED vec3 at, n;
uniform vec4 colour;
uniform vec3 eye, sun, look, sky, tile;
uniform int kind;
float tiles(vec2 p) {
  vec2 w = max(fwidth(p), 1e-4);
  vec2 i = 2.0 * (abs(fract((p - 0.5 * w) * 0.5) - 0.5) - abs(fract((p + 0.5 * w) * 0.5) - 0.5)) / w;
  return 0.5 - 0.5 * i.x * i.y;
}
void main() {
  if (kind == FLOOR) {
    float far = smoothstep(8.0, 38.0, distance(at, look));
    SEEN = vec4(mix(mix(tile, tile * 0.92, tiles(at.xy * 0.5)), sky, far), 1.0);
  } else if (kind == PATH) {
    SEEN = vec4(colour.rgb, colour.a * clamp((1.0 - abs(n.x)) / fwidth(n.x), 0.0, 1.0));
  } else if (kind == SHADOW) {
    SEEN = colour;
  } else {
    vec3 to = normalize(eye - at), normal = normalize(n), light = -normalize(sun);
    if (dot(normal, to) < 0.0) normal = -normal;
    float lit = 0.55 + 0.25 * normal.z + 0.35 * max(dot(normal, light), 0.0);
    float shine = pow(max(dot(normal, normalize(light + to)), 0.0), 40.0);
    float glass = kind == GLASS ? 0.45 * pow(1.0 - max(dot(normal, to), 0.0), 3.0) + 0.5 * shine : 0.0;
    SEEN = vec4(colour.rgb * min(lit, 1.15) + 0.25 * shine, min(1.0, colour.a + glass));
  }
}
