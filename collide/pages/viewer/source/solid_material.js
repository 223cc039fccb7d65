/**
 * The one material of all bodies: lit, with a colour, an opacity and a pattern for each instance of a batch.
 *
 * The fourth number of an instance's colour holds two: 2 · pattern + opacity. Patterns lie on the screen, so that they
 * read alike on every body. Zero normals stand for the facet's own (`shape_geometry.js`), and what a section plane lays
 * open is painted flat and hatched.
 */
import { Color, DoubleSide, MeshLambertMaterial, Vector4 } from "three";

/** GLSL that sets `ink` by `colorPattern` and `pixel`, the place on the screen: rows of `verdicts.js`. */
export const INK = `if ( colorPattern == 1.0 ) ink = step( mod( pixel.x + pixel.y, 7.0 ), 2.4 );
  else if ( colorPattern == 2.0 ) ink = step( mod( pixel.x - pixel.y, 11.0 ), 2.0 );
  else if ( colorPattern == 3.0 ) ink = step( distance( mod( pixel, 7.0 ), vec2( 3.5 ) ), 1.7 );
  else if ( colorPattern == 4.0 ) ink = step( mod( pixel.y, 7.0 ), 1.6 );
  else if ( colorPattern == 5.0 ) ink = step( 0.5, abs( step( 4.0, mod( pixel.x, 8.0 ) ) - step( 4.0, mod( pixel.y, 8.0 ) ) ) ) * 0.45;
  else if ( colorPattern == 6.0 ) ink = max( step( mod( pixel.x + pixel.y, 9.0 ), 2.0 ), step( mod( pixel.x - pixel.y, 9.0 ), 2.0 ) );
`;
const UNPACK = `
  float colorPattern = floor( vColor.a * 0.5 + 0.01 );
  float colorOpacity = clamp( vColor.a - 2.0 * colorPattern, 0.0, 1.0 );
  vec2 pixel = gl_FragCoord.xy / pixelsPerUnit;
  float ink = 0.0;
  ${INK}  diffuseColor = vec4( vColor.rgb * ( 1.0 - 0.34 * ink ), colorOpacity );
`;
const NORMAL = `
  float faceDirection = gl_FrontFacing ? 1.0 : - 1.0;
  vec3 normal = dot( vNormal, vNormal ) < 1e-8
    ? normalize( cross( dFdx( vViewPosition ), dFdy( vViewPosition ) ) )
    : normalize( vNormal ) * faceDirection;
  vec3 nonPerturbedNormal = normal;
`;
const SECTION = `
  if ( cutsOpen > 0.5 && ! gl_FrontFacing ) {
    float hatch = step( mod( pixel.x + pixel.y, 5.0 ), 1.2 );
    outgoingLight = vColor.rgb * ( 0.42 - 0.22 * hatch );
  }
  #include <opaque_fragment>
`;

/** The material, and `uniforms` that the stage sets: pixelsPerUnit, cutsOpen. */
export function solidMaterial() {
  const uniforms = { pixelsPerUnit: { value: 1 }, cutsOpen: { value: 0 } };
  const material = new MeshLambertMaterial({
    side: DoubleSide, transparent: true, forceSinglePass: true, // opacity is sorted by body: one pass is enough
    polygonOffset: true, polygonOffsetFactor: 1.5, polygonOffsetUnits: 4,
  });
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms);
    shader.vertexShader = shader.vertexShader.replace("#include <normal_vertex>", "vNormal = transformedNormal;");
    shader.fragmentShader = `uniform float pixelsPerUnit;\nuniform float cutsOpen;\n${shader.fragmentShader}`
      .replace("#include <color_fragment>", UNPACK)
      .replace("#include <normal_fragment_begin>", NORMAL)
      .replace("#include <opaque_fragment>", SECTION);
  };
  return { material, uniforms };
}

const color = new Color();

/** Colour, pattern and opacity as the four numbers of an instance. */
export function paint(hex, pattern, opacity) {
  color.set(hex);
  return new Vector4(color.r, color.g, color.b, 2 * pattern + Math.min(opacity, 0.999));
}
