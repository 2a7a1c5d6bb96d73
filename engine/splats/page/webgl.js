// Draws with a graphics processor: a drawer as the viewer takes them, or nothing if the browser has none. A slow one, which is the
// processor in disguise, is taken only where it is forced.
function graphics(surface, forced) {
  const gl = surface.getContext("webgl2", { antialias: false, alpha: false, failIfMajorPerformanceCaveat: !forced });
  if (!gl || !(gl.getExtension("EXT_color_buffer_float") || gl.getExtension("EXT_color_buffer_half_float"))) return null;
  // Some browsers tell the name without asking, and warn of those that ask.
  const told = gl.getParameter(gl.RENDERER), named = /^WebKit/.test(told) && gl.getExtension("WEBGL_debug_renderer_info");
  const renderer = named ? gl.getParameter(named.UNMASKED_RENDERER_WEBGL) : told;
  if (!forced && /swiftshader|llvmpipe|softpipe|software|basic render/i.test(renderer)) return null;
  function program(vertexText, fragmentText) {
    const made = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertexText], [gl.FRAGMENT_SHADER, fragmentText]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw Error(gl.getShaderInfoLog(shader));
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw Error(gl.getProgramInfoLog(made));
    const at = {};
    for (let n = 0; n < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); n++) {
      const { name } = gl.getActiveUniform(made, n);
      at[name] = gl.getUniformLocation(made, name);
    }
    return { made, at };
  }

  let splats, sums, depth, count = 0;
  function texture(at, format, width, rows, shape, kind, numbers) {
    const made = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0 + at);
    gl.bindTexture(gl.TEXTURE_2D, made);
    gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, rows);
    if (numbers) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, rows, shape, kind, numbers);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
    return made;
  }
  const passes = { depth: program(vertex, depthPass), blend: program(vertex, blendPass), light: program(screenVertex, lightPass) };
  const corners = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, corners);
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), gl.STATIC_DRAW);
  const squares = gl.createVertexArray();
  const screen = gl.createVertexArray();
  gl.bindVertexArray(screen);
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
  const frame = gl.createFramebuffer();

  // As large as the picture; what lies between is made anew.
  function resize(width, height) {
    if (surface.width === width && surface.height === height && sums) return;
    Object.assign(surface, { width, height });
    gl.deleteTexture(sums);
    gl.deleteRenderbuffer(depth);
    sums = texture(0, gl.RGBA16F, width, height);
    depth = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, sums, 0);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
  }

  // Takes the splats of a level, as the worker packs them; false if they are more than it holds.
  function take({ rows, places, others, count: of_level }) {
    if (rows > gl.getParameter(gl.MAX_TEXTURE_SIZE)) return false;
    (splats || []).forEach((old) => gl.deleteTexture(old));
    splats = [texture(1, gl.RGBA32UI, 4096, rows, gl.RGBA_INTEGER, gl.UNSIGNED_INT, places),
      texture(2, gl.R32UI, 4096, rows, gl.RED_INTEGER, gl.UNSIGNED_INT, others)];
    gl.activeTexture(gl.TEXTURE0);
    count = of_level;
    return true;
  }

  function draw() {
    if (!count) return false;
    resize(...size);
    const { right, up, towards } = axes(), { at: from, distance } = eye(), lowest = [-1e30, -1e30, -1e30], highest = cut_at();
    // What may be seen lies so far before the eye.
    const around = Math.hypot(...part.high.map((c, a) => c - part.low[a])) * 0.6, of_part = dot(from, towards);
    const far = Math.max(of_part + around, part.edge * 1e-6), range = [Math.max(of_part - around, far * 1e-3), far];
    gl.viewport(0, 0, surface.width, surface.height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.clearColor(0, 0, 0, 0);
    gl.clearDepth(1);
    gl.depthMask(true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.bindVertexArray(squares);
    const pass = ({ made, at }, back) => {
      gl.useProgram(made);
      for (const [name, value] of Object.entries({ origin: part.origin, right, up, towards, centre: view.centre, eye: from, lowest, highest }))
        gl.uniform3fv(at[name] ?? null, value);
      gl.uniform1f(at.edge, part.edge);
      gl.uniform1f(at.distance, distance);
      gl.uniform1i(at.parallel, view.opening ? 0 : 1);
      gl.uniform2fv(at.range, range);
      gl.uniform1f(at.back, back);
      gl.uniform1i(at.open, state.axis >= 0 ? 1 : 0);
      gl.uniform1i(at.places, 1);
      gl.uniform1i(at.others, 2);
      gl.uniform2f(at.scale, 2 / view.height * surface.height / surface.width, 2 / view.height);
      gl.drawArrays(gl.TRIANGLES, 0, 6 * count);
    };
    // The nearest splats, moved back by what may lie together; then all that are before that.
    gl.colorMask(false, false, false, false);
    gl.disable(gl.BLEND);
    pass(passes.depth, 0.715);
    gl.colorMask(true, true, true, true);
    gl.depthMask(false);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE);
    pass(passes.blend, 0);
    gl.disable(gl.BLEND);
    gl.disable(gl.DEPTH_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.useProgram(passes.light.made);
    const lamp = ([x, y, z]) => unitOf([0, 1, 2].map((a) => right[a] * x + up[a] * y + towards[a] * z));
    gl.uniform3fv(passes.light.at.key, lamp([-0.55, 0.65, 0.55]));
    gl.uniform3fv(passes.light.at.fill, lamp([0.8, -0.1, 0.5]));
    for (const [name, value] of Object.entries({ towards, right, up })) gl.uniform3fv(passes.light.at[name], value);
    gl.uniform2f(passes.light.at.middle, surface.width / 2, surface.height / 2);
    gl.uniform1f(passes.light.at.pixel, view.height / surface.height);
    gl.uniform1f(passes.light.at.distance, distance);
    gl.uniform1i(passes.light.at.parallel, view.opening ? 0 : 1);
    gl.uniform1i(passes.light.at.style, state.style);
    gl.uniform1i(passes.light.at.deepest, part.deepest);
    gl.bindVertexArray(screen);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    return true;
  }
  // When the last picture can be read.
  const finished = () => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  return { name: "webgl", surface, take, draw, finished };
}
