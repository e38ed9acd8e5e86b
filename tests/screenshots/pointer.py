"""A pointer that is drawn on the page, because a screenshot does not show that of the mouse."""

SHOW_POINTER = """() => {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  const arrow = document.createElementNS("http://www.w3.org/2000/svg", "path");
  arrow.setAttribute("d", "M2 2 L2 26 L8 20 L13 31 L17 29 L12 19 L20 19 Z");
  arrow.setAttribute("fill", "#fff");
  arrow.setAttribute("stroke", "#000");
  arrow.setAttribute("stroke-width", "2");
  svg.append(arrow);
  svg.id = "drawn-pointer";
  Object.assign(svg.style, {
    position: "fixed", width: "36px", height: "36px", zIndex: "9999", pointerEvents: "none",
  });
  document.body.append(svg);
  addEventListener("mousemove", (event) => {
    svg.style.left = `${event.clientX - 2}px`;
    svg.style.top = `${event.clientY - 2}px`;
  }, { capture: true });
}"""
"""JavaScript: adds the pointer, which follows the mouse and takes no clicks."""
