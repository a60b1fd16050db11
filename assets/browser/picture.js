// Drawing of a frame's pixels, with overlays mixed in.

/** Draws frames into a canvas that has the frame's own size; CSS scales it. */
export class Picture {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.image = null;
    this.tissueColours = new Uint8Array(3 * 256);
    this.attenuationColours = new Uint8Array(3 * 256);
    /** Whether each tissue number occurred in the last overlay. */
    this.seen = new Uint8Array(256);
    this.grey = new Uint32Array(256).map((_, g) => (0xff << 24) | (g << 16) | (g << 8) | g);
  }

  setColours(tissues, attenuation) {
    this.tissueColours.fill(0);
    for (const { number, colour } of tissues) if (number < 256) this.tissueColours.set(colour, 3 * number);
    attenuation.forEach((colour, i) => this.attenuationColours.set(colour, 3 * i));
  }

  /** `overlays`: { segmentation: {data, opacity} | null, attenuation: {data, opacity} | null }. */
  draw(frame, overlays) {
    const { width, height, data } = frame;
    if (!this.image || this.image.width !== width || this.image.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
      this.image = this.context.createImageData(width, height);
      this.words = new Uint32Array(this.image.data.buffer);
    }
    const { words, grey } = this;
    for (let i = 0; i < data.length; i++) words[i] = grey[data[i]];
    // Attenuation has a value only inside the sector; 0 leaves the picture unchanged.
    if (overlays.attenuation) this.mix(overlays.attenuation, this.attenuationColours, null);
    if (overlays.segmentation) this.mix(overlays.segmentation, this.tissueColours, this.seen.fill(0));
    this.context.putImageData(this.image, 0, 0);
  }

  /** Shows a picture of the cine loop. */
  show(bitmap) {
    if (this.canvas.width !== bitmap.width || this.canvas.height !== bitmap.height) {
      Object.assign(this.canvas, { width: bitmap.width, height: bitmap.height });
      this.image = null;
    }
    this.context.drawImage(bitmap, 0, 0);
  }

  mix({ data, opacity }, colours, seen) {
    const pixels = this.image.data;
    const above = Math.round(256 * opacity);
    const below = 256 - above;
    const part = Uint16Array.from(colours, (value) => value * above);
    for (let i = 0, p = 0; i < data.length; i++, p += 4) {
      const value = data[i];
      if (value === 0) continue;
      if (seen) seen[value] = 1;
      const c = 3 * value;
      pixels[p] = (pixels[p] * below + part[c]) >> 8;
      pixels[p + 1] = (pixels[p + 1] * below + part[c + 1]) >> 8;
      pixels[p + 2] = (pixels[p + 2] * below + part[c + 2]) >> 8;
    }
  }
}
