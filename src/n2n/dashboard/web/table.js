// Tables that sort by any column.

const ROWS_AT_FIRST = 300;

// columns: {name, title, of: row -> value to sort by, show: row -> node or text, numeric}
function sortable(columns, caption) {
  let order = null,
    descending = false,
    rows = [],
    all = false;
  const body = h("tbody");
  const showAll = () => {
    all = true;
    fill();
  };
  const more = button("", showAll, { hidden: true });
  const heads = columns.map((column) =>
    h(
      "th",
      { scope: "col", class: column.numeric ? "number" : "", "aria-sort": "none" },
      h(
        "button",
        { type: "button", title: column.title ?? column.name, onclick: () => sortBy(column) },
        column.name,
        h("span", { class: "arrow", "aria-hidden": "true" }),
      ),
    ),
  );
  const sortBy = (column) => {
    descending = order === column ? !descending : false;
    order = column;
    heads.forEach((head, i) =>
      head.setAttribute("aria-sort", columns[i] === order ? (descending ? "descending" : "ascending") : "none"),
    );
    fill();
  };
  const fill = () => {
    const sorted = order ? [...rows].sort((a, b) => compare(order.of(a), order.of(b), descending)) : rows;
    const shown = all ? sorted : sorted.slice(0, ROWS_AT_FIRST);
    body.replaceChildren(
      ...shown.map((row) =>
        h(
          "tr",
          {},
          columns.map((column) => h("td", { class: column.numeric ? "number" : "" }, column.show(row))),
        ),
      ),
    );
    more.hidden = shown.length === sorted.length;
    more.textContent = `Show all ${sorted.length} rows`;
  };
  const table = h("table", {}, h("caption", {}, caption), h("thead", {}, h("tr", {}, heads)), body);
  const node = h(
    "div",
    {},
    h("div", { class: "scroller", tabindex: 0, role: "group", "aria-label": caption }, table),
    more,
  );
  return {
    node,
    set: (given) => {
      rows = given;
      fill();
    },
  };
}

// Missing values stand last, whichever way the rest is sorted.
function compare(a, b, descending) {
  const gone = (one) => one === undefined || one === null || one === "";
  if (gone(a) || gone(b)) return gone(a) - gone(b);
  const sign = descending ? -1 : 1;
  if (isNumber(a) && isNumber(b)) return sign * (a - b);
  return sign * String(a).localeCompare(String(b), "en", { numeric: true });
}

function plainTable(heads, rows, caption) {
  return h(
    "div",
    { class: "scroller", tabindex: 0, role: "group", "aria-label": caption },
    h(
      "table",
      {},
      h("caption", {}, caption),
      heads.length
        ? h(
            "thead",
            {},
            h(
              "tr",
              {},
              heads.map((head) => h("th", { scope: "col" }, head)),
            ),
          )
        : null,
      h(
        "tbody",
        {},
        rows.map((cells) =>
          h(
            "tr",
            {},
            cells.map((cell, i) => (i === 0 ? h("th", { scope: "row" }, cell) : h("td", {}, cell))),
          ),
        ),
      ),
    ),
  );
}
