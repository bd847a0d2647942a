"use strict";
// Tables: sorted by a column, filtered by policy, intervals folded until they are asked for.
(function () {
  for (const controls of document.querySelectorAll(".table-controls")) {
    const table = document.getElementById(controls.dataset.table);
    const body = table.tBodies[0], lines = [...body.rows], heads = [...table.tHead.rows[0].cells];
    const filter = controls.querySelector("[type=search]"), fold = controls.querySelector("[type=checkbox]");
    const order = controls.querySelector("select"), told = controls.querySelector("output");

    const raw = (line, column) => line.cells[column].dataset.value;
    const words = (column) => lines.some((line) => raw(line, column) !== "" && Number.isNaN(Number(raw(line, column))));
    function compare(column, up) {
      const sign = up ? 1 : -1;
      if (words(column)) return (a, b) => sign * raw(a, column).localeCompare(raw(b, column));
      return (a, b) => {
        const x = raw(a, column), y = raw(b, column);
        if (x === "" || y === "") return (x === "") - (y === "");
        return sign * (Number(x) - Number(y));
      };
    }
    function sort(column, up) {
      heads.forEach((head, k) => {
        if (k === column) head.setAttribute("aria-sort", up ? "ascending" : "descending");
        else head.removeAttribute("aria-sort");
      });
      body.append(...(column < 0 ? lines : [...lines].sort(compare(column, up))));
      order.value = column < 0 ? "" : column + (up ? " up" : " down");
    }
    heads.forEach((head, column) => {
      const name = head.textContent, button = document.createElement("button");
      button.type = "button";
      button.textContent = name;
      head.replaceChildren(button);
      const firstUp = words(column);
      button.addEventListener("click", () => {
        const before = head.getAttribute("aria-sort");
        const up = before === null ? firstUp : before === "descending";
        if (before !== null && up === firstUp) sort(-1, true);
        else sort(column, up);
      });
      for (const up of words(column) ? [true, false] : [false, true]) {
        order.append(new Option(name + (words(column) ? (up ? ", A to Z" : ", Z to A") : (up ? ", least first" : ", greatest first")), column + (up ? " up" : " down")));
      }
    });
    order.addEventListener("change", () => {
      const [column, way] = order.value.split(" ");
      sort(order.value === "" ? -1 : Number(column), way === "up");
    });
    filter.addEventListener("input", () => {
      const asked = filter.value.trim().toLowerCase();
      for (const line of lines) line.hidden = !raw(line, 0).toLowerCase().includes(asked);
      const shown = lines.filter((line) => !line.hidden).length;
      told.textContent = asked === "" ? "" : shown + " of " + lines.length;
    });
    const unfold = () => table.classList.toggle("folded", !fold.checked);
    fold.addEventListener("change", unfold);
    unfold();
  }
})();
