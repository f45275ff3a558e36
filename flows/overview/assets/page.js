/* What the page does without asking its server. */
"use strict";

window.aerocal = {
  /* The server's last answer, and by the clock of this browser: when it came, and how far that clock is ahead, ms. */
  answer: { time: null, came: 0, ahead: 0 },
  /* Page of a run in Prefect. */
  runPage: function (dashboard, run) {
    return dashboard + "/v2/runs/flow-run/" + encodeURIComponent(run);
  },
};

window.dash_clientside = Object.assign({}, window.dash_clientside, {
  overview: {
    /* Answers may come twice or late: what is there already is replaced, never added again. */
    news: function (news) {
      if (news) window.dash_ag_grid.getApiAsync("projects").then((grid) => {
        /* The first project with a stage may come while the page is open. */
        grid.setColumnsVisible(news.columns, true);
        if (news.whole) {
          grid.setGridOption("rowData", news.rows);
          return;
        }
        const known = (row) => Boolean(grid.getRowNode(row.key));
        grid.applyTransaction({
          add: news.rows.filter((row) => !known(row)),
          update: news.rows.filter(known),
          remove: news.removed.map((key) => ({ key: key })).filter(known),
        });
      });
      return window.dash_clientside.no_update;
    },

    search: function (text) {
      window.dash_ag_grid.getApiAsync("projects").then((grid) => grid.setGridOption("quickFilterText", text || ""));
      return window.dash_clientside.no_update;
    },

    exported: function (clicks) {
      if (clicks) window.dash_ag_grid.getApiAsync("projects").then((grid) => grid.exportDataAsCsv({
        fileName: "projects.csv", processCellCallback: window.dashAgGridFunctions.csvCell,
      }));
      return window.dash_clientside.no_update;
    },

    /* Show only the states of a card; a second click shows all again. */
    only: function () {
      const context = window.dash_clientside.callback_context;
      const asked = context.triggered_id;
      /* Cards that have just been drawn anew were not clicked. */
      if (!asked || !context.triggered[0].value) return window.dash_clientside.no_update;
      window.dash_ag_grid.getApiAsync("projects").then((grid) => {
        const now = JSON.stringify((grid.getFilterModel() || {}).state || null);
        const conditions = asked.states.split(" ").map((state) => ({
          filterType: "text", type: "equals", filter: state,
        }));
        const wanted = conditions.length === 1 ? conditions[0]
          : { filterType: "text", operator: "OR", conditions: conditions };
        const same = now !== "null" && asked.states.split(" ").every((state) => now.includes(state));
        grid.setColumnFilterModel("state", same ? null : wanted).then(() => grid.onFilterChanged());
      });
      return window.dash_clientside.no_update;
    },

    /* Ages grow; a page whose server is silent says so. */
    tick: function (_ticks, refreshed) {
      const answer = window.aerocal.answer;
      if (refreshed && refreshed !== answer.time) Object.assign(answer, {
        time: refreshed, came: performance.now(), ahead: Date.now() - Date.parse(refreshed),
      });
      window.dash_ag_grid.getApiAsync("projects").then((grid) => {
        grid.refreshCells({ columns: ["changed", "seconds"], force: true });
        /* Beside two columns that stay, a narrow screen has no room for those that do not, and the grid
           lets go of both. */
        const narrow = window.matchMedia("(max-width: 800px)").matches;
        grid.applyColumnState({ state: [
          { colId: "project", pinned: "left" }, { colId: "state", pinned: narrow ? null : "left" },
        ] });
      });
      if (!refreshed) return "";
      const silent = (performance.now() - answer.came) / 1000;
      return silent < 45 ? "" : "No answer for " + Math.round(silent) +
        " s: what you see is old. Is aerocal serve still running?";
    },
  },
});
