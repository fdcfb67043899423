/** Materials of a character: glTF material definitions as materials of three.js. */

import * as THREE from "three";

import type { Materials, TextureMessage } from "../reader/index.js";

/** Roughness of a surface without a material: like skin, wood or matt paint. */
const DEFAULT_ROUGHNESS = 0.58;
const WRAPS: Record<number, THREE.Wrapping> = {
  10497: THREE.RepeatWrapping, 33071: THREE.ClampToEdgeWrapping, 33648: THREE.MirroredRepeatWrapping,
};

/** Returns the material of a surface with only vertex colours. */
export function plainMaterial(): THREE.Material {
  return new THREE.MeshStandardMaterial({
    vertexColors: true, roughness: DEFAULT_ROUGHNESS, metalness: 0, side: THREE.DoubleSide,
  });
}

/** Loads the textures of a character. Call `changed` when an image has been decoded. */
export class MaterialLoader {
  private readonly cache = new Map<string, THREE.Texture>();

  constructor(private readonly materials: Materials, private readonly changed: () => void) {}

  /** Returns the material with that number; -1 is a surface with only vertex colours. */
  load(number: number): THREE.Material {
    if (number < 0) return plainMaterial();
    const definition = parse(this.materials.definitions[number]);
    const pbr = definition.pbrMetallicRoughness ?? {};
    const extensions = definition.extensions ?? {};
    const [r, g, b, opacity] = numbers(pbr.baseColorFactor, [1, 1, 1, 1]);
    const shared = {
      vertexColors: true,
      color: new THREE.Color(r, g, b),
      map: this.texture(pbr.baseColorTexture, true),
      side: definition.doubleSided === true ? THREE.DoubleSide : THREE.FrontSide,
      opacity,
      transparent: definition.alphaMode === "BLEND",
      alphaTest: definition.alphaMode === "MASK" ? number_(definition.alphaCutoff, 0.5) : 0,
    };
    if (extensions.KHR_materials_unlit) return new THREE.MeshBasicMaterial(shared);
    const finish = this.texture(pbr.metallicRoughnessTexture, false);
    const strength = number_(extensions.KHR_materials_emissive_strength?.emissiveStrength, 1);
    const [er, eg, eb] = numbers(definition.emissiveFactor, [0, 0, 0]);
    const normalScale = number_(definition.normalTexture?.scale, 1);
    return new THREE.MeshStandardMaterial({
      ...shared,
      metalness: number_(pbr.metallicFactor, 1),
      roughness: number_(pbr.roughnessFactor, 1),
      metalnessMap: finish,
      roughnessMap: finish,
      normalMap: this.texture(definition.normalTexture, false),
      normalScale: new THREE.Vector2(normalScale, normalScale),
      aoMap: this.texture(definition.occlusionTexture, false),
      aoMapIntensity: number_(definition.occlusionTexture?.strength, 1),
      emissive: new THREE.Color(er, eg, eb),
      emissiveIntensity: strength,
      emissiveMap: this.texture(definition.emissiveTexture, true),
    });
  }

  /** Frees the images on the GPU. */
  dispose(): void {
    for (const texture of this.cache.values()) texture.dispose();
  }

  private texture(info: any, isColour: boolean): THREE.Texture | null {
    const message = this.materials.textures[info?.index];
    if (message === undefined) return null;
    const key = JSON.stringify([info, isColour]);
    let texture = this.cache.get(key);
    if (texture === undefined) {
      texture = loadTexture(message, this.changed);
      texture.colorSpace = isColour ? THREE.SRGBColorSpace : THREE.NoColorSpace;
      const transform = info.extensions?.KHR_texture_transform ?? {};
      texture.channel = transform.texCoord ?? info.texCoord ?? 0;
      const [x, y] = numbers(transform.offset, [0, 0]);
      const [across, down] = numbers(transform.scale, [1, 1]);
      const turn = number_(transform.rotation, 0);
      const [c, s] = [Math.cos(turn), Math.sin(turn)];
      // glTF scales before it rotates. The fields repeat and rotation of three.js have the other order.
      texture.matrixAutoUpdate = false;
      texture.matrix.set(c * across, s * down, x, -s * across, c * down, y, 0, 0, 1);
      this.cache.set(key, texture);
    }
    return texture;
  }
}

/** Returns a texture whose image arrives later. A damaged image leaves it white. */
function loadTexture(message: TextureMessage, changed: () => void): THREE.Texture {
  const texture = new THREE.Texture();
  const sampler = parse(message.sampler);
  texture.wrapS = WRAPS[sampler.wrapS] ?? THREE.RepeatWrapping;
  texture.wrapT = WRAPS[sampler.wrapT] ?? THREE.RepeatWrapping;
  texture.magFilter = sampler.magFilter === 9728 ? THREE.NearestFilter : THREE.LinearFilter;
  texture.flipY = false;
  texture.anisotropy = 4;
  const options = { colorSpaceConversion: "none", premultiplyAlpha: "none" } as const;
  createImageBitmap(new Blob([message.image as BlobPart]), options).then(
    (image) => {
      texture.image = image;
      texture.needsUpdate = true;
      changed();
    },
    () => console.warn("a texture could not be decoded"),
  );
  return texture;
}

/** Returns the JSON object of a text; an empty object for anything else. */
function parse(text: string): any {
  try {
    const value = JSON.parse(text || "{}");
    return typeof value === "object" && value !== null ? value : {};
  } catch {
    return {};
  }
}

const number_ = (value: unknown, otherwise: number): number =>
  typeof value === "number" && Number.isFinite(value) ? value : otherwise;

function numbers(value: unknown, otherwise: number[]): number[] {
  const isList = Array.isArray(value) && value.length === otherwise.length;
  return isList ? value.map((entry, at) => number_(entry, otherwise[at])) : otherwise;
}
