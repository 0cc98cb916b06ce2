// A figure in a browser: uPlot gives axes and the rectangle of a zoom; lines, points, bars and areas are painted here.

const contents = JSON.parse(document.getElementById("contents").textContent);
readInk();
document.querySelector("h1").textContent = contents.title;
document.getElementById("below").textContent = contents.below;
const main = document.querySelector("main");
main.style.setProperty("--columns", contents.columns);
const panels = contents.panels.map((panel) => new Panel(panel, main));
fillLegend(document.getElementById("legend"), contents.legend);
document.getElementById("whole").addEventListener("click", showWhole);
const recolour = () => {
  readInk();
  for (const panel of panels) panel.recolour();
  for (const paintAgain of swatches) paintAgain();
};
dark.addEventListener("change", recolour);
recolour();
