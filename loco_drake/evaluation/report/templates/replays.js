// Puts a replay together from its pieces, and shows it, when its button is pressed.
(() => {
  const stage = document.getElementById("stage");
  const buttons = [...document.querySelectorAll("[data-replay]")];
  let data = null;
  for (const button of buttons) {
    button.addEventListener("click", () => {
      data ??= JSON.parse(document.getElementById("replay-data").textContent);
      const page = data.pages[button.dataset.replay].map(i => data.pieces[i]).join("");
      const frame = document.createElement("iframe");
      frame.title = "Replay: " + button.dataset.title;
      frame.srcdoc = page;
      stage.replaceChildren(frame);
      for (const other of buttons) {
        other.setAttribute("aria-pressed", String(other === button));
      }
    });
  }
})();
