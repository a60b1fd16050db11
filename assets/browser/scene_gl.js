// WebGL 2 renderer of the 3-D view: surfaces and the fan in a parallel projection.

const VERTEX = `#version 300 es
layout(location = 0) in vec3 position;
layout(location = 1) in vec2 image_position;
uniform mat3 turn;      // scene_from_model
uniform vec3 shift;
uniform mat3 view;      // rows: right, up, forward
uniform vec3 target;
uniform vec3 half_size; // mm shown to either side
out vec3 in_scene;
out vec2 at;
void main() {
  in_scene = turn * position + shift;
  at = image_position;
  gl_Position = vec4(view * (in_scene - target) / half_size, 1.0);
}`;

const SURFACE = `#version 300 es
precision highp float;
in vec3 in_scene;
in vec2 at;
uniform vec4 colour;
uniform vec3 light;
uniform vec4 cut;        // normal toward the viewer, offset; all 0: none
out vec4 shown;
void main() {
  if (cut.xyz != vec3(0.0) && dot(cut.xyz, in_scene) > cut.w) discard;
  vec3 normal = normalize(cross(dFdx(in_scene), dFdy(in_scene)));
  float lit = 0.3 + 0.7 * abs(dot(normal, light));
  // At a cut the inside of a surface is visible; it is drawn flat.
  if (cut.xyz != vec3(0.0) && !gl_FrontFacing) lit = 0.62;
  shown = vec4(colour.rgb * lit * colour.a, colour.a);
}`;

const FAN = `#version 300 es
precision highp float;
in vec3 in_scene;
in vec2 at;
uniform sampler2D image;
uniform float has_image;
out vec4 shown;
void main() {
  float grey = texture(image, at).r;
  shown = mix(vec4(vec3(1.0, 0.8, 0.3) * 0.3, 0.3), vec4(vec3(grey) * 0.94, 0.94), has_image);
}`;

const LINE = `#version 300 es
precision highp float;
in vec3 in_scene;
in vec2 at;
out vec4 shown;
void main() { shown = vec4(1.0, 0.8, 0.35, 1.0); }`;

/** Opacity from which on a surface hides what is behind it. */
const SOLID = 0.95;
/** Opacity from which on a surface hides its own back. */
const GLASS = 0.3;
const FAN_STEPS = 64;

function program(gl, fragment) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader) ?? "a shader is refused");
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made) ?? "a program is refused");
  const uniforms = {};
  for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(made, i);
    uniforms[name] = gl.getUniformLocation(made, name);
  }
  return { made, uniforms };
}

/** Renderer of a scene packet. `open` returns `null` without WebGL 2. */
export class SceneGl {
  static open(canvas) {
    const settings = { alpha: false, preserveDrawingBuffer: true };
    // Edges are smoothed only if a GPU draws them.
    const gl = canvas.getContext("webgl2", { ...settings, antialias: true, failIfMajorPerformanceCaveat: true })
      ?? canvas.getContext("webgl2", { ...settings, antialias: false });
    return gl && new SceneGl(gl);
  }

  constructor(gl) {
    this.gl = gl;
    this.surface = program(gl, SURFACE);
    this.fan = program(gl, FAN);
    this.line = program(gl, LINE);
    this.parts = [];
    this.texture = gl.createTexture();
    this.fanBuffer = gl.createBuffer();
    this.fanArray = gl.createVertexArray();
    gl.bindVertexArray(this.fanArray);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.fanBuffer);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 20, 0);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 2, gl.FLOAT, false, 20, 12);
    this.imageSize = null;
  }

  /** `surfaces`: [{ positions: Float32Array, indices: Uint32Array, … }] */
  load(surfaces) {
    const { gl } = this;
    for (const { array, buffers } of this.parts) {
      gl.deleteVertexArray(array);
      buffers.forEach((buffer) => gl.deleteBuffer(buffer));
    }
    this.parts = surfaces.map(({ positions, indices }) => {
      const array = gl.createVertexArray();
      const buffers = [gl.createBuffer(), gl.createBuffer()];
      gl.bindVertexArray(array);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[0]);
      gl.bufferData(gl.ARRAY_BUFFER, positions, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(0);
      gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers[1]);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
      return { array, buffers, count: indices.length };
    });
    gl.bindVertexArray(null);
  }

  /** Makes the frame's grey levels the image in the fan. */
  setImage(frame) {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    const size = `${frame.width} ${frame.height}`;
    if (this.imageSize === size) {
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, frame.width, frame.height, gl.RED, gl.UNSIGNED_BYTE, frame.data);
      return;
    }
    this.imageSize = size;
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, frame.width, frame.height, 0, gl.RED, gl.UNSIGNED_BYTE, frame.data);
    for (const [key, value] of [
      [gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
    ]) gl.texParameteri(gl.TEXTURE_2D, key, value);
  }

  /** Strip between the face and the far arc of `probe` in the probe frame, with texture positions in the image of `frame`. */
  setFan(probe, frame) {
    const { gl } = this;
    const { pixelMm, width, height, faceRow } = frame;
    const depth = frame.settings.depth_mm;
    const radius = probe.face_radius_mm;
    const values = [];
    const push = (x, z) => values.push(x, 0, z, (x / pixelMm + width / 2) / width, (z / pixelMm + faceRow) / height);
    for (let i = 0; i <= FAN_STEPS; i++) {
      const lateral = (2 * i / FAN_STEPS - 1) * probe.half_extent;
      if (radius === null) {
        push(lateral, 0);
        push(lateral, depth);
      } else {
        const [sin, cos] = [Math.sin(lateral), Math.cos(lateral)];
        push(radius * sin, radius * (cos - 1));
        push((radius + depth) * sin, (radius + depth) * cos - radius);
      }
    }
    // The outline is the same points as a loop: the face, then the far end back.
    const corner = (i) => values.slice(5 * i, 5 * i + 5);
    const loop = [];
    for (let i = 0; i <= FAN_STEPS; i++) loop.push(...corner(2 * i));
    for (let i = FAN_STEPS; i >= 0; i--) loop.push(...corner(2 * i + 1));
    gl.bindBuffer(gl.ARRAY_BUFFER, this.fanBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([...values, ...loop]), gl.DYNAMIC_DRAW);
  }

  /** A function that tells whether everything drawn so far is finished. A lost context counts as finished. */
  fence() {
    const { gl } = this;
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    return () => {
      const isDone = !fence || gl.isContextLost() || gl.getSyncParameter(fence, gl.SYNC_STATUS) === gl.SIGNALED;
      if (isDone && fence) gl.deleteSync(fence);
      return isDone;
    };
  }

  /** Draws only the depth of what `draw` draws, so that afterwards only its front is visible. */
  front(draw) {
    const { gl } = this;
    gl.colorMask(false, false, false, false);
    gl.depthMask(true);
    draw();
    gl.depthMask(false);
    gl.colorMask(true, true, true, true);
  }

  /**
   * `camera`: { right, up, forward, target, half: [x, y, z] }; `looks`: [{ colour, opacity, tool }], one per surface;
   * `poses`: { turn (columns), shift } by tool, without tools of unknown pose; `cut`: [x, y, z, offset] or null.
   */
  draw(camera, looks, poses, cut, withImage) {
    const { gl } = this;
    const pose = poses.probe;
    gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    gl.clearColor(0.031, 0.039, 0.051, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    const use = ({ made, uniforms }, tool) => {
      gl.useProgram(made);
      const identity = [1, 0, 0, 0, 1, 0, 0, 0, 1];
      gl.uniformMatrix3fv(uniforms.turn, false, tool ? poses[tool].turn : identity);
      gl.uniform3fv(uniforms.shift, tool ? poses[tool].shift : [0, 0, 0]);
      const { right: r, up: u, forward: f } = camera;
      gl.uniformMatrix3fv(uniforms.view, false, [r[0], u[0], f[0], r[1], u[1], f[1], r[2], u[2], f[2]]);
      gl.uniform3fv(uniforms.target, camera.target);
      gl.uniform3fv(uniforms.half_size, camera.half);
      return uniforms;
    };
    const light = [0, 1, 2].map((i) => -0.8 * camera.forward[i] + 0.5 * camera.up[i] - 0.35 * camera.right[i]);
    const part = (index, opacity) => {
      const look = looks[index];
      const uniforms = use(this.surface, look.tool);
      gl.uniform4f(uniforms.colour, ...look.colour, opacity);
      gl.uniform3fv(uniforms.light, light.map((v) => v / Math.hypot(...light)));
      gl.uniform4fv(uniforms.cut, cut && !look.tool ? cut : [0, 0, 0, 0]);
      gl.bindVertexArray(this.parts[index].array);
      gl.drawElements(gl.TRIANGLES, this.parts[index].count, gl.UNSIGNED_INT, 0);
    };
    const shown = looks.map((look, index) => ({ ...look, index })).filter((l) => l.opacity > 0.004 && (!l.tool || poses[l.tool]));
    gl.depthMask(true);
    shown.filter((l) => l.opacity >= SOLID).forEach((l) => part(l.index, 1));
    if (pose) {
      gl.bindVertexArray(this.fanArray);
      const uniforms = use(this.fan, "probe");
      gl.uniform1i(uniforms.image, 0);
      gl.uniform1f(uniforms.has_image, withImage ? 1 : 0);
      gl.activeTexture(gl.TEXTURE0);
      gl.bindTexture(gl.TEXTURE_2D, this.texture);
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 2 * FAN_STEPS + 2);
    }
    // Transparent surfaces: the most transparent ones enclose the others, and are drawn last.
    gl.depthMask(false);
    for (const { index, opacity } of shown.filter((l) => l.opacity < SOLID).sort((a, b) => b.opacity - a.opacity)) {
      if (opacity >= GLASS) this.front(() => part(index, opacity));
      part(index, opacity);
    }
    if (pose) {
      gl.disable(gl.DEPTH_TEST);
      gl.bindVertexArray(this.fanArray);
      use(this.line, "probe");
      gl.drawArrays(gl.LINE_LOOP, 2 * FAN_STEPS + 2, 2 * FAN_STEPS + 2);
    }
    gl.bindVertexArray(null);
    gl.depthMask(true);
  }
}
