// What is said about the joint, load or point under the pointer.

/** Name, kind and loads of what was hit, at (x, y) in the picture; nothing where nothing was hit. */
function showTip(tip, scene, frame, hit, x, y) {
  tip.hidden = !hit;
  if (!hit) return;
  const { run } = scene, lines = [`${hit.label} (${hit.kind})`];
  if (hit.joint !== undefined) {
    const open = run.scene.joints[hit.joint].open.map((yes) => (yes ? ", not unique" : ""));
    lines.push(`force ${short(length(run.tables.force.vector(frame, hit.joint)))} N${open[0]}`);
    lines.push(`moment ${short(length(run.tables.moment.vector(frame, hit.joint)))} N m${open[1]}`);
  }
  if (hit.load !== undefined) lines.push(`force ${short(length(run.tables[`load${hit.load}`].vector(frame, 1)))} N`);
  if (hit.kind === "point") lines.push(`at ${hit.point.map((x) => short(x)).join(", ")} m`);
  tip.textContent = lines.join("\n");
  tip.style.left = tip.style.top = "0"; // at the border a box would be narrowed before it is measured
  tip.style.left = `${Math.max(4, Math.min(x + 14, scene.camera.width - tip.offsetWidth - 4))}px`;
  tip.style.top = `${Math.max(4, Math.min(y + 14, scene.camera.height - tip.offsetHeight - 4))}px`;
}
