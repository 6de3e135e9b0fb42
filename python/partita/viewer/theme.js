// Colours on light and on dark paper. Shapes read COLOURS; the page's style has its own table of the same two themes.

const THEMES = {
  light: {
    paper: "#ffffff", ink: "#1d2730", quiet: "#566472", edge: "#3c4854", ground: "#77828c", foot: "#eef1f4", grid: "#e6ebef",
    free: "#c96500", force: "#b3261e", moment: "#6b3fa0", load: "#0b6e4f", impulse: "#8a5a00", spring: "#4d5b68", joint: "#f4f6f8",
    trace: "#7d93a8", halo: "rgba(255,255,255,0.9)",
    bodies: ["#8fb0d0", "#a3c4a0", "#d3bd8c", "#b3a6d0", "#8fc2c2", "#d0a3b0", "#b7c48c", "#a5b1bf"],
    lines: ["#1f6fb4", "#b34c00", "#12785a", "#a02a58", "#6a63ad"],
  },
  dark: {
    paper: "#14191e", ink: "#e6ebef", quiet: "#a3b0bc", edge: "#0a0d10", ground: "#8995a0", foot: "#2a333b", grid: "#29323a",
    free: "#ff9d3c", force: "#ff7a6e", moment: "#c3a2f5", load: "#5fd0a6", impulse: "#ffd166", spring: "#b4c0cb", joint: "#dfe5ea",
    trace: "#6f8aa3", halo: "rgba(20,25,30,0.9)",
    bodies: ["#6f97bd", "#83ad80", "#bda468", "#998abf", "#6cabab", "#bd8594", "#9eac6c", "#8997a6"],
    lines: ["#6db3f2", "#ffa35c", "#57cfa4", "#f08ab0", "#b5aef5"],
  },
};

const COLOURS = { ...THEMES.light };
const prefersDark = window.matchMedia("(prefers-color-scheme: dark)");

/** Show a theme, "light" or "dark"; the style follows an attribute of the page. */
function setTheme(name) {
  Object.assign(COLOURS, THEMES[name]);
  document.documentElement.dataset.theme = name;
  const button = document.getElementById("theme");
  button.textContent = name === "dark" ? "Light" : "Dark";
  button.title = name === "dark" ? "dark writing on light paper (D)" : "light writing on dark paper (D)";
}
