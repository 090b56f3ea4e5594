// Elements. Children are nodes or plain text: nothing that a run says is ever read as HTML.

const SVG = "http://www.w3.org/2000/svg";

function build(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

function h(tag, attributes = {}, ...children) {
  return build(document.createElement(tag), attributes, children);
}

function s(tag, attributes = {}, ...children) {
  return build(document.createElementNS(SVG, tag), attributes, children);
}

// Draw now and again whenever the width changes; nothing is drawn while the element is hidden.
function whenSized(element, draw) {
  let width = 0;
  const redraw = () => {
    const now = element.clientWidth;
    if (now && now !== width) draw((width = now));
  };
  new ResizeObserver(redraw).observe(element);
  return () => {
    width = 0;
    redraw();
  };
}

function button(text, onclick, attributes = {}) {
  return h("button", { type: "button", onclick, ...attributes }, text);
}

function selectBox(label, options, chosen, onchange) {
  const box = h(
    "select",
    { onchange: () => onchange(box.value) },
    options.map(([value, text]) => h("option", { value, selected: value === chosen }, text)),
  );
  return h("label", { class: "choice" }, h("span", {}, label), box);
}
