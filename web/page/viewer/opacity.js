// Opacity of the layers of viser's page, loaded into it. It is set where the scene is drawn, so that
// each page has its own, and none costs the console a byte. viser has no opacity for points, lines
// and images; the objects that it draws are found by the name of their node in the state that its
// pages keep in React.

(() => {
  // Numbers of three.js: https://threejs.org/docs/#api/en/constants/CustomBlendingEquations
  const CUSTOM_BLENDING = 5;
  const CONSTANT_ALPHA = 213;
  const ONE_MINUS_CONSTANT_ALPHA = 214;
  const CHANGED = ["transparent", "opacity", "blending", "blendSrc", "blendDst", "blendAlpha"];
  const MAX_FIBERS = 20_000;
  const ROBOT = "/robot/base"; // the node that every scene has, sooner or later
  const originals = new WeakMap(); // material → its own values
  let strengths = {};
  let viser = null;

  window.addEventListener("fade", ({ detail }) => {
    // A layer that gets its own opacity back is drawn with it once more.
    strengths = { ...Object.fromEntries(Object.keys(strengths).map((name) => [name, 1])), ...detail };
    window.dispatchEvent(new Event("seen"));
  });

  // The mutable state of viser's viewer: scene, and objects by the name of their node.
  function findViser() {
    const root = document.getElementById("root");
    const key = Object.keys(root ?? {}).find((name) => name.startsWith("__reactContainer$"));
    const open = key ? [root[key]] : [];
    for (let visited = 0; open.length && visited < MAX_FIBERS; visited += 1) {
      const fiber = open.pop();
      const state = fiber.memoizedProps?.value?.mutable?.current;
      if (state?.nodeRefFromName && state.scene) return state;
      for (const next of [fiber.sibling, fiber.child]) if (next) open.push(next);
    }
    return null;
  }

  function fade(material, strength) {
    if (!originals.has(material)) {
      if (strength === 1) return;
      originals.set(material, Object.fromEntries(CHANGED.map((name) => [name, material[name]])));
    }
    const own = originals.get(material);
    if (strength === 1) Object.assign(material, own);
    else if (own.transparent) material.opacity = own.opacity * strength;
    else {
      Object.assign(material, { transparent: true, blending: CUSTOM_BLENDING, blendAlpha: strength });
      Object.assign(material, { blendSrc: CONSTANT_ALPHA, blendDst: ONE_MINUS_CONSTANT_ALPHA });
    }
  }

  function fadeAll() {
    const faded = new Set();
    for (const [layer, strength] of Object.entries(strengths)) {
      viser.nodeRefFromName[`/${layer}`]?.traverse(({ material }) => {
        for (const one of material ? [material].flat() : []) fade(one, strength);
        if (material && strength < 1) faded.add(layer);
      });
    }
    // For programs that drive the page: the layers that are drawn faded.
    document.documentElement.dataset.faded = [...faded].join(" ");
    window.isRobotDrawn = Boolean(viser.nodeRefFromName[ROBOT]);
  }

  // Called before each frame; the scene itself calls before it is drawn, when all nodes are new.
  window.prepareFrame = () => {
    if (!viser) viser = findViser();
    if (viser?.scene && viser.scene.onBeforeRender !== fadeAll) viser.scene.onBeforeRender = fadeAll;
  };
})();
