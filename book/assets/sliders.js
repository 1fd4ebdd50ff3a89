// Lets the reader move the curves of a picture with sliders.  Without this script, and in print, the
// picture stands as it is; what moves it lies in the page, and Bokeh beside this script.
"use strict";
{
  const library = new URL("bokeh.min.js", document.currentScript.src);
  let loaded;

  function loadBokeh() {
    loaded ??= new Promise((done, failed) => {
      const script = document.createElement("script");
      script.src = library;
      script.onload = done;
      script.onerror = () => failed(new Error(`${library} is not there`));
      document.head.append(script);
    });
    return loaded;
  }

  async function start(picture) {
    await loadBokeh();
    const { item, sliders, vectors, frames, notes } = JSON.parse(
      picture.querySelector("script").textContent,
    );
    const curves = vectors.map((values) => values.map((v) => v ?? NaN)); // JSON has no NaN
    const inputs = [...picture.querySelectorAll("input")];
    const output = picture.querySelector(".rcbook-note");
    picture.hidden = false; // it needs a width to be drawn in
    picture.closest("figure").classList.add("rcbook-moves");
    await Bokeh.embed.embed_item(item, picture.querySelector(".rcbook-chart"));
    const chart = Bokeh.documents.find((one) => one.get_model_by_id(item.root_id));

    function show() {
      let frame = 0; // that of the last slider changes fastest
      inputs.forEach((input, i) => {
        frame = frame * sliders[i].settings.length + input.valueAsNumber;
        const setting = sliders[i].settings[input.valueAsNumber];
        input.setAttribute("aria-valuetext", setting);
        input.nextElementSibling.textContent = setting;
      });
      output.textContent = notes[frame];
      frames[frame].forEach(([x, y], i) => {
        chart.get_model_by_name(`curve-${i}`).data = { x: curves[x], y: curves[y] };
      });
    }

    picture.addEventListener("input", show);
    show();
    picture.dataset.ready = "";
  }

  // Bokeh is large, and drawn off screen a picture moves nothing that is being read.
  const near = new IntersectionObserver(
    (seen) => {
      for (const { target } of seen.filter((one) => one.isIntersecting)) {
        near.unobserve(target);
        start(target.querySelector(".rcbook-sliders"));
      }
    },
    { rootMargin: "800px" },
  );
  // It comes to stand between the still picture, which is in the cell before, and its caption.
  for (const picture of document.querySelectorAll(".rcbook-sliders")) {
    const figure = picture.closest(".cell").previousElementSibling.querySelector("figure");
    figure.querySelector("figcaption").before(picture);
    near.observe(figure);
  }
}
