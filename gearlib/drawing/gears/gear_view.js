// Moves the wheels and arrows of a view of gears to the frame of the slider.
"use strict";
(function () {
  const frames = JSON.parse(document.querySelector("script[type='application/json']").textContent);
  const wheels = Array.from(document.querySelectorAll("g.wheel")), arrows = Array.from(document.querySelectorAll("path.force"));
  const slider = document.querySelector("input[type=range]"), button = document.querySelector("button");
  const caption = document.querySelector("text.caption");
  let timer = null;

  function arrow([x1, y1, x2, y2]) {
    const length = Math.hypot(x2 - x1, y2 - y1), ux = length ? (x2 - x1) / length : 1, uy = length ? (y2 - y1) / length : 0;
    const head = Math.min(9, 0.6 * length), bx = x2 - head * ux, by = y2 - head * uy, half = 0.38 * head;
    const points = [[x1, y1], [bx, by], [bx - half * uy, by + half * ux], [x2, y2], [bx + half * uy, by - half * ux], [bx, by]];
    return "M" + points.map(p => p.map(v => v.toFixed(2)).join(" ")).join(" L");
  }

  function show(k) {
    const frame = frames[k];
    caption.textContent = frame.caption;
    wheels.forEach((wheel, i) => {
      const [x, y, angle] = frame.wheels[i];
      wheel.setAttribute("transform", `translate(${x} ${y})`);
      wheel.querySelector("g.turn").setAttribute("transform", `rotate(${angle})`);
    });
    arrows.forEach((path, i) => path.setAttribute("d", arrow(frame.arrows[i])));
  }

  function step() {
    slider.value = (Number(slider.value) + 1) % frames.length;
    show(Number(slider.value));
  }

  slider.addEventListener("input", () => show(Number(slider.value)));
  button.addEventListener("click", () => {
    if (timer === null) {
      timer = setInterval(step, 60);
      button.textContent = "Pause";
    } else {
      clearInterval(timer);
      timer = null;
      button.textContent = "Play";
    }
  });
  show(0);
})();
