// Names beside the points of a plot, where there is room for them: no name lies over another, over
// a point or outside the plot. Where there is none beside a point, its name stands farther off, at
// the end of a line; what finds no room there either has no name (the legend tells every colour).
"use strict";
(() => {
  const PER_LETTER = 6.4;
  const HEIGHT = 12;
  const GAPS = [7, 22, 40];

  const overlap = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
  // Right of a point, left of it, above, below, and at its four corners.
  const around = ({ x, y }, width, gap) => [
    [x + gap, y - HEIGHT / 2], [x - gap - width, y - HEIGHT / 2],
    [x - width / 2, y - gap - HEIGHT], [x - width / 2, y + gap],
    [x + gap / 2, y - gap - HEIGHT / 2], [x + gap / 2, y + gap - HEIGHT / 2],
    [x - gap / 2 - width, y - gap - HEIGHT / 2], [x - gap / 2 - width, y + gap - HEIGHT / 2],
  ].map(([left, top]) => ({ left, top, right: left + width, bottom: top + HEIGHT }));

  // The line from a point to the nearest place of a box, and the box around that line.
  const leaderTo = (box, { x, y }) => {
    const within = (value, least, most) => Math.min(Math.max(value, least), most);
    return { x1: x, y1: y, x2: within(x, box.left, box.right), y2: within(y, box.top, box.bottom) };
  };
  const boxOf = ({ x1, y1, x2, y2 }) => ({
    left: Math.min(x1, x2) - 1, right: Math.max(x1, x2) + 1, top: Math.min(y1, y2) - 1, bottom: Math.max(y1, y2) + 1,
  });

  // By name, of `named` (points with x, y and a name) those that have room: x and y (baseline) of the
  // text's left end and, where it stands farther off, the leader to it. `points` are all points of
  // the plot, `area` is its left, right, top and bottom.
  envlight.labelsOf = (named, points, area) => {
    const dots = points.map(({ x, y }) => ({ left: x - 5, right: x + 5, top: y - 5, bottom: y + 5 }));
    const drawn = [];
    const clear = (box, others) => !others.some((other) => overlap(box, other));
    const inside = (box) => box.left >= area.left && box.right <= area.right && box.top >= area.top && box.bottom <= area.bottom;
    const found = new Map();
    for (const gap of GAPS) {
      for (const point of named) {
        if (found.has(point.name)) continue;
        const leader = (box) => gap > GAPS[0] && leaderTo(box, point);
        const box = around(point, PER_LETTER * point.name.length, gap).find((one) => (
          inside(one) && clear(one, dots) && clear(one, drawn) && (!leader(one) || clear(boxOf(leader(one)), drawn))
        ));
        if (!box) continue;
        drawn.push(box);
        if (leader(box)) drawn.push(boxOf(leader(box)));
        found.set(point.name, { x: box.left, y: box.bottom - 3, leader: leader(box) });
      }
    }
    return found;
  };
})();
