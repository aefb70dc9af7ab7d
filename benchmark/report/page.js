(() => {
  "use strict";
  const tip = document.createElement("div");
  tip.id = "tip";
  tip.setAttribute("role", "status");
  document.body.append(tip);

  const show = (text, event) => {
    const [first, ...rest] = text.split("\n");
    tip.replaceChildren(Object.assign(document.createElement("b"), { textContent: first }));
    rest.forEach((line) => tip.append(Object.assign(document.createElement("div"), { textContent: line })));
    tip.classList.add("on");
    const box = tip.getBoundingClientRect();
    const left = event.clientX + 14 + box.width > innerWidth ? event.clientX - 14 - box.width : event.clientX + 14;
    const top = event.clientY + 16 + box.height > innerHeight ? event.clientY - 16 - box.height : event.clientY + 16;
    tip.style.transform = `translate(${Math.max(left, 6)}px, ${Math.max(top, 6)}px)`;
  };
  const hide = () => tip.classList.remove("on");

  /* One policy lit up in a section; a chip that is pressed keeps it lit. */
  const light = (section, policy) => {
    section.classList.toggle("lit", Boolean(policy));
    section.querySelectorAll("[data-policy]").forEach((item) => {
      item.classList.toggle("on", item.dataset.policy === policy);
    });
  };
  const kept = (section) => section.querySelector(".chip[aria-pressed=true]")?.dataset.policy;

  document.querySelectorAll("main > section").forEach((section) => {
    section.addEventListener("pointerover", (event) => {
      const item = event.target.closest("[data-policy]");
      light(section, item && !item.matches(".row, tr") ? item.dataset.policy : kept(section));
    });
    section.addEventListener("pointerleave", () => light(section, kept(section)));
    section.addEventListener("click", (event) => {
      const chip = event.target.closest(".chip");
      if (!chip) return;
      const pressed = chip.getAttribute("aria-pressed") === "true";
      section.querySelectorAll(".chip").forEach((other) => other.setAttribute("aria-pressed", "false"));
      chip.setAttribute("aria-pressed", String(!pressed));
      light(section, kept(section));
    });
  });

  const read = new WeakMap();
  const decision = (strip, event) => {
    if (!read.has(strip)) read.set(strip, JSON.parse(strip.dataset.decisions));
    const told = read.get(strip);
    const seconds = (event.clientX - strip.getBoundingClientRect().left) / told.scale;
    let end = told.began;
    for (let i = 0; i < told.seconds.length; i += 1) {
      const start = end;
      end += told.seconds[i].reduce((sum, value) => sum + value, 0);
      if (seconds >= start && seconds < end) {
        const spent = told.phases
          .map((name, j) => [name.replace(/_/g, " "), told.seconds[i][j]])
          .filter((pair) => pair[1] > 0)
          .map((pair) => `${pair[0]} ${pair[1].toFixed(2)} s`);
        const lines = [`${start.toFixed(1)} to ${end.toFixed(1)} s`, ...spent, `net rate then ${told.rate[i]} %`];
        if (told.words[i]) lines.splice(1, 0, told.words[i]);
        return lines.join("\n");
      }
    }
    return "";
  };

  const tell = (event) => {
    const strip = event.target.closest("[data-decisions]");
    const item = event.target.closest("[data-tip]");
    const text = strip ? decision(strip, event) : item?.dataset.tip;
    if (text) show(text, event);
    else hide();
  };
  document.addEventListener("pointermove", tell);
  document.addEventListener("pointerdown", tell);
  document.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && hide());
  addEventListener("scroll", hide, { passive: true, capture: true });
})();
