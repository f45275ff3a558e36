// Long tables: a search, an order by any column, and a file of the rows shown. Nothing leaves the page.
for (const box of document.querySelectorAll(".scroll.list")) {
  const table = box.querySelector("table"), body = table.tBodies[0], rows = [...body.rows];
  const headings = [...table.tHead.rows[0].cells];
  const value = (cell) => cell.dataset.value ?? cell.textContent;
  const tools = document.createElement("p"), search = document.createElement("input");
  const count = document.createElement("span"), save = document.createElement("button");
  tools.className = "tools";
  search.type = "search";
  search.placeholder = "Search";
  search.setAttribute("aria-label", "Search " + table.caption.textContent);
  save.textContent = "Save as CSV";
  tools.append(search, save, count);
  box.before(tools);
  const tell = () => {
    const shown = rows.filter((row) => !row.hidden).length;
    count.textContent = `${shown.toLocaleString("en")} of ${rows.length.toLocaleString("en")} rows`;
  };
  search.addEventListener("input", () => {
    const words = search.value.toLowerCase().split(/\s+/);
    for (const row of rows) {
      const text = [...row.cells].map((cell) => cell.textContent.toLowerCase());
      row.hidden = !words.every((word) => text.some((own) => own.includes(word)));
    }
    tell();
  });
  const order = (place) => {
    const down = headings[place].ariaSort === "ascending", sign = down ? -1 : 1;
    headings.forEach((heading, k) => { heading.ariaSort = k !== place ? "none" : down ? "descending" : "ascending"; });
    const numeric = !headings[place].classList.contains("words");
    const keyed = rows.map((row) => [value(row.cells[place]), row]);
    const compared = numeric
      ? (a, b) => (a === "") - (b === "") || sign * (Number(a) - Number(b))
      : (a, b) => sign * a.localeCompare(b, "en", { numeric: true });
    body.append(...keyed.sort(([a], [b]) => compared(a, b)).map(([, row]) => row));
  };
  headings.forEach((heading, place) => {
    heading.tabIndex = 0;
    heading.title = "Sort by this column";
    heading.addEventListener("click", () => order(place));
    heading.addEventListener("keydown", (pressed) => { if (pressed.key === "Enter") order(place); });
  });
  save.addEventListener("click", () => {
    const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    const named = headings.map((heading) => [...heading.childNodes].map((part) => part.textContent).join(" "));
    const shown = [...body.rows].filter((row) => !row.hidden).map((row) => [...row.cells].map(value));
    const lines = [named, ...shown].map((line) => line.map(quoted).join(","));
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([lines.join("\r\n") + "\r\n"], { type: "text/csv" }));
    link.download = `${table.id}.csv`;
    link.click();
    URL.revokeObjectURL(link.href);
  });
  tell();
}
