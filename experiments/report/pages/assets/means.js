// Mean errors, mean ranks and ratios over what is chosen, from the rows that come with a page and by
// the rules of the reports. Intervals and tests come along over everything, and are shown for that
// alone.
"use strict";
window.envlight = window.envlight || { runs: new Map() };
(() => {
  const { runs } = envlight;

  // A table of little-endian numbers in base64; all machines that browsers run on store them so.
  const unpacked = (text, Type) => new Type(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);

  envlight.add = (data) => {
    for (const budget of data.budgets) {
      budget.counts = unpacked(budget.counts, Uint8Array);
      for (const table of Object.values(budget.metrics)) {
        table.errors = unpacked(table.errors, Float64Array);
        table.floors = unpacked(table.floors, Float64Array);
      }
      for (const name of Object.keys(budget.costs)) budget.costs[name] = unpacked(budget.costs[name], Float32Array);
      for (const found of Object.values(budget.published)) {
        for (const name of ["low", "high", "p", "rankLow", "rankHigh"]) if (found[name]) found[name] = unpacked(found[name], Float64Array);
      }
    }
    runs.set(data.name, data);
  };

  // A number (0 or more) with so many decimals as the reports write it: what lies half-way between
  // two goes to the even one, where toFixed takes the larger. Only multiples of a power of 2 can.
  envlight.fixed = (value, places) => {
    const scaled = value * 10 ** places;
    const below = Math.floor(scaled);
    const halfway = Number.isInteger(value * 2 ** (places + 1)) && scaled - below === 0.5;
    return (halfway && below % 2 === 0 ? below / 10 ** places : value).toFixed(places);
  };

  const sum = (values) => values.reduce((total, value) => total + value, 0);
  const mean = (values) => sum(values) / values.length;

  // The cases of the chosen maps and scenes on which every chosen sampler has all its seeds: as
  // many as the most that it has on any of them. A sampler without a row there takes no part; one that
  // is over the budget is not ranked.
  const compared = (data, budget, chosen) => {
    const width = data.samplers.length;
    const places = data.cases.map((_, place) => place).filter((place) => {
      const [scene, map] = data.cases[place];
      return chosen.scenes[scene] && chosen.maps[map];
    });
    const most = data.samplers.map((_, k) => Math.max(0, ...places.map((place) => budget.counts[place * width + k])));
    const samplers = data.samplers.map((_, k) => k).filter((k) => chosen.samplers[k] && most[k] > 0);
    const cases = places.filter((place) => samplers.every((k) => budget.counts[place * width + k] === most[k]));
    const over = samplers.filter((k) => budget.over[k]);
    return { samplers: samplers.filter((k) => !budget.over[k]), over, cases };
  };

  // Means over the cases of each map, by the maps' names, without what is no number.
  const perMap = (data, cases, value) => {
    const groups = new Map();
    for (const place of cases) {
      const map = data.cases[place][1];
      if (!groups.has(map)) groups.set(map, []);
      const found = value(place);
      if (!Number.isNaN(found)) groups.get(map).push(found);
    }
    return [...groups.entries()].sort((a, b) => a[0] - b[0]).map(([map, found]) => [map, found.length ? mean(found) : NaN]);
  };

  // Ranks of one map's errors, 1 for the smallest, equal ones sharing the better rank.
  const ranksOf = (errors) => errors.map((error) => 1 + errors.filter((other) => other < error).length);

  // Errors by map (rows) and sampler, as measured and as ranked: none below `near` times the floor.
  const tables = (data, budget, metric, { samplers, cases }) => {
    const { errors, floors } = budget.metrics[metric];
    const width = data.samplers.length;
    const columns = samplers.map((k) => perMap(data, cases, (place) => errors[place * width + k]));
    const least = perMap(data, cases, (place) => floors[place]).map(([, floor]) => envlight.constants.near * floor);
    const maps = columns.length ? columns[0].map(([map]) => map) : [];
    const measured = maps.map((_, row) => columns.map((column) => column[row][1]));
    const ranked = measured.map((line, row) => line.map((error) => (error < least[row] ? least[row] : error)));
    return { maps, measured, ranked, ranks: ranked.map(ranksOf) };
  };

  const everything = (data) => ({
    samplers: data.samplers.map(() => true), maps: data.maps.map(() => true), scenes: data.scenes.map(() => true),
  });
  envlight.everything = everything;
  envlight.isWhole = (chosen) => Object.values(chosen).every((flags) => flags.every(Boolean));

  // The ranking by a metric at a budget, over what is chosen: the best mean rank first. Of costs
  // and errors the means; to the error of the baseline geometric means over maps.
  // chosen : whether each sampler, map and scene takes part; baseline : to whose error ratios are
  envlight.ranking = (data, name, metric, chosen = everything(data), baseline = "") => {
    const budget = data.budgets.find((found) => found.name === name);
    const width = data.samplers.length;
    const fair = compared(data, budget, chosen);
    const metrics = [metric, ...Object.keys(budget.metrics).filter((other) => other !== metric)];
    const all = metrics.map((one) => tables(data, budget, one, fair));
    const means = all.map(({ ranks }) => fair.samplers.map((_, k) => mean(ranks.map((line) => line[k]))));
    const order = fair.samplers.map((_, k) => k).sort((a, b) => {
      for (const ranks of means) if (ranks[a] !== ranks[b] && !Number.isNaN(ranks[a])) return ranks[a] - ranks[b];
      return data.samplers[fair.samplers[a]] < data.samplers[fair.samplers[b]] ? -1 : 1;
    });
    const picked = (table) => table.map((line) => order.map((k) => line[k]));
    const [measured, ranked, ranks] = [all[0].measured, all[0].ranked, all[0].ranks].map(picked);
    const names = order.map((k) => data.samplers[fair.samplers[k]]);
    const found = { metric, budget: name, maps: ranked.length, cases: fair.cases.length, samplers: names };
    const base = Math.max(0, names.indexOf([baseline, envlight.constants.baseline].find((one) => names.includes(one))));
    if (!ranked.length || !names.length) return { ...found, lines: [], over: [], baseline: "", published: null };
    const positive = ranked.filter((line) => line.every((error) => error > 0 && Number.isFinite(error)));
    const published = envlight.isWhole(chosen) ? budget.published[metric] : null;
    const costsOf = (index) => Object.fromEntries(envlight.constants.costs.map(({ name: kind }) => [kind, cost(kind, index)]));
    const pair = (table, one, other) => {
      const [row, column] = [names[one], names[other]].map((sampler) => published.samplers.indexOf(sampler));
      return table[row * published.samplers.length + column];
    };
    const known = (one, other) => (published?.p
      ? { low: pair(published.low, one, other), high: pair(published.high, one, other), p: pair(published.p, one, other) }
      : { low: NaN, high: NaN, p: NaN });
    const cost = (kind, k) => {
      const values = fair.cases.map((place) => budget.costs[kind][place * width + k]).filter((value) => !Number.isNaN(value));
      return values.length ? mean(values) : NaN;
    };
    const rank = order.map((k) => means[0][k]);
    const count = (test) => ranked.filter((line, row) => test(line, row)).length;
    const lines = names.map((sampler, k) => {
      const index = fair.samplers[order[k]];
      return {
        sampler, index, rank: rank[k],
        place: 1 + rank.filter((other) => other < rank[k]).length,
        error: mean(measured.map((line) => line[k])),
        firsts: count((_, row) => ranks[row][k] === 1),
        shared: count((_, row) => ranks[row][k] === 1 && ranks[row].filter((other) => other === 1).length > 1),
        rankLow: published?.rankLow?.[published.samplers.indexOf(sampler)] ?? NaN,
        rankHigh: published?.rankHigh?.[published.samplers.indexOf(sampler)] ?? NaN,
        alike: k > 0 && known(0, k).p > envlight.constants.level,
        ratio: positive.length ? Math.exp(mean(positive.map((line) => Math.log(line[k]) - Math.log(line[base])))) : NaN,
        ...known(k, base),
        smaller: count((line) => line[k] < line[base]),
        equal: count((line) => line[k] === line[base]),
        larger: count((line) => line[k] > line[base]),
        costs: costsOf(index),
      };
    });
    const over = fair.over.map((index) => ({
      sampler: data.samplers[index], index, costs: costsOf(index), error: mean(perMap(data, fair.cases,
        (place) => budget.metrics[metric].errors[place * width + index]).map(([, error]) => error)),
    }));
    return { ...found, lines, over, baseline: names[base], published };
  };
})();
