// Ranks, ratios with intervals and tests of pairs, from the rows that come with a page: the same
// statistics, on the same rules and by the same random numbers, as those of the reports (summary,
// rankings and metrics.ranking), so that a filter that leaves everything in gives their tables.
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
      for (const name of Object.keys(budget.costs)) {
        budget.costs[name] = unpacked(budget.costs[name], Float32Array);
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
  // many as the most that it has on any of them. A sampler without a row there takes no part.
  const compared = (data, budget, chosen) => {
    const width = data.samplers.length;
    const places = data.cases.map((_, place) => place).filter((place) => {
      const [scene, map] = data.cases[place];
      return chosen.scenes[scene] && chosen.maps[map];
    });
    const most = data.samplers.map((_, k) => Math.max(0, ...places.map((place) => budget.counts[place * width + k])));
    const samplers = data.samplers.map((_, k) => k).filter((k) => chosen.samplers[k] && most[k] > 0);
    const cases = places.filter((place) => samplers.every((k) => budget.counts[place * width + k] === most[k]));
    return { samplers, cases };
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

  // PCG64 (O'Neill 2014, XSL-RR), as NumPy's default generator runs it: 128 bits in six limbs of 22,
  // whose products and their sums are exact in a double.
  const LIMB = 2 ** 22;
  const limbsOf = (words) => {
    let whole = 0n;
    for (let k = 3; k >= 0; k -= 1) whole = (whole << 32n) | BigInt(words[k]);
    return Array.from({ length: 6 }, (_, k) => Number((whole >> BigInt(22 * k)) & 0x3fffffn));
  };
  const MULTIPLIER = limbsOf([0x9fccf645, 0x4385df64, 0x1fc65da4, 0x2360ed05]);
  const uniforms = () => {
    const increment = limbsOf(envlight.constants.increment);
    let state = limbsOf(envlight.constants.state);
    return () => {
      const next = [0, 0, 0, 0, 0, 0];
      let carry = 0;
      for (let k = 0; k < 6; k += 1) {
        let total = carry + increment[k];
        for (let i = 0; i <= k; i += 1) total += state[i] * MULTIPLIER[k - i];
        carry = Math.floor(total / LIMB);
        next[k] = total - carry * LIMB;
      }
      next[5] %= 2 ** 18;
      state = next;
      const [a, b, c, d, e, f] = next;
      const top = (e >>> 8) | (f << 14);
      let low = (a | (b << 22)) ^ ((c >>> 20) | (d << 2) | (e << 24));
      let high = ((b >>> 10) | (c << 12)) ^ top;
      let turn = top >>> 26;
      if (turn >= 32) { [low, high] = [high, low]; turn -= 32; }
      if (turn) {
        [low, high] = [(low >>> turn) | (high << (32 - turn)), (high >>> turn) | (low << (32 - turn))];
      }
      return ((high >>> 5) * 67108864 + ((low >>> 0) >>> 6)) / 9007199254740992;
    };
  };

  // A binomial number by inversion, as NumPy draws it where n · p is small.
  const binomial = (next, n, p) => {
    if (n === 0 || p === 0) return 0;
    if (p > 0.5) return n - binomial(next, n, 1 - p);
    const q = 1 - p;
    const start = Math.exp(n * Math.log1p(-p));
    const bound = Math.trunc(Math.min(n, n * p + 10 * Math.sqrt(n * p * q + 1)));
    let found = 0;
    let chance = start;
    let left = next();
    while (left > chance) {
      found += 1;
      if (found > bound) {
        [found, chance, left] = [0, start, next()];
      } else {
        left -= chance;
        chance = ((n - found + 1) * p * chance) / (found * q);
      }
    }
    return found;
  };

  // How often each of so many maps is drawn, with replacement, resample by resample.
  const draws = new Map();
  const drawn = (count) => {
    if (draws.has(count)) return draws.get(count);
    const { resamples } = envlight.constants;
    const times = new Uint8Array(resamples * count);
    const next = uniforms();
    for (let row = 0; row < resamples; row += 1) {
      let [left, share] = [count, 1];
      for (let k = 0; k < count - 1 && left > 0; k += 1) {
        const found = binomial(next, left, 1 / count / share);
        times[row * count + k] = found;
        left -= found;
        share -= 1 / count;
      }
      if (left > 0) times[row * count + count - 1] = left;
    }
    draws.set(count, times);
    return times;
  };

  const quantile = (sorted, share) => {
    const at = share * (sorted.length - 1);
    const low = Math.floor(at);
    const high = Math.min(low + 1, sorted.length - 1);
    return sorted[low] + (sorted[high] - sorted[low]) * (at - low);
  };

  // Geometric mean over maps of errors over the baseline's, with its interval; all columns of logs
  // (maps × samplers) against the one at `base`.
  const ratios = (logs, base) => {
    const count = logs.length;
    const times = drawn(count);
    const { resamples, confidence } = envlight.constants;
    const tail = 0.5 * (1 - confidence);
    return logs[0].map((_, k) => {
      const differences = logs.map((line) => line[k] - line[base]);
      const means = new Float64Array(resamples);
      for (let row = 0; row < resamples; row += 1) {
        let total = 0;
        for (let map = 0; map < count; map += 1) total += times[row * count + map] * differences[map];
        means[row] = total / count;
      }
      means.sort();
      return {
        ratio: Math.exp(mean(differences)),
        low: Math.exp(quantile(means, tail)),
        high: Math.exp(quantile(means, 1 - tail)),
      };
    });
  };

  // Share of the normal distribution beyond z ≥ 0: a series near the middle, a continued fraction
  // (Abramowitz and Stegun 7.1.6 and 26.2.14) farther out.
  const beyond = (z) => {
    const density = Math.exp(-0.5 * z * z) / Math.sqrt(2 * Math.PI);
    if (z > 4) {
      let fraction = z;
      for (let k = 60; k >= 1; k -= 1) fraction = z + k / fraction;
      return density / fraction;
    }
    let [term, total] = [z, z];
    for (let k = 1; k < 200; k += 1) {
      term *= (z * z) / (2 * k + 1);
      total += term;
    }
    return 0.5 - density * total;
  };

  // Wilcoxon's two-sided p-value by the rules of SciPy's `wilcoxon`: differences of zero are left
  // out; exact up to 50 of them, with equal sizes up to 13; else by the normal distribution.
  envlight.signedRank = (differences) => {
    const values = differences.filter((value) => value !== 0);
    const count = values.length;
    if (!count) return 1;
    const sizes = values.map(Math.abs);
    const sorted = [...sizes].sort((a, b) => a - b);
    const doubled = sizes.map((size) => {  // twice the rank, so that it is a whole number
      const first = sorted.indexOf(size);
      return 2 * first + 1 + sorted.lastIndexOf(size) - first + 1;
    });
    const positive = sum(doubled.filter((_, k) => values[k] > 0));
    const tied = new Set(sizes).size < count;
    if (count <= 50 && (!tied || count <= 13)) {
      const whole = sum(doubled);
      let shares = new Float64Array(whole + 1);
      shares[0] = 1;
      for (const rank of doubled) {
        const next = new Float64Array(whole + 1);
        for (let total = 0; total <= whole; total += 1) {
          next[total] = 0.5 * (shares[total] + (total >= rank ? shares[total - rank] : 0));
        }
        shares = next;
      }
      return Math.min(1, 2 * Math.min(sum(shares.subarray(0, positive + 1)), sum(shares.subarray(positive))));
    }
    let ties = 0;
    for (let k = 0; k < count;) {
      const last = sorted.lastIndexOf(sorted[k]);
      ties += (last - k + 1) ** 3 - (last - k + 1);
      k = last + 1;
    }
    const spread = Math.sqrt((count * (count + 1) * (2 * count + 1) - ties / 2) / 24);
    const z = (positive / 2 - (count * (count + 1)) / 4) / spread;
    return Math.min(1, 2 * beyond(Math.abs(z)));
  };

  const holm = (values) => {
    const order = values.map((_, k) => k).sort((a, b) => values[a] - values[b] || a - b);
    const corrected = new Array(values.length);
    let most = 0;
    order.forEach((k, place) => {
      most = Math.max(most, values[k] * (values.length - place));
      corrected[k] = Math.min(1, most);
    });
    return corrected;
  };

  // Every pair's corrected p-value, samplers × samplers.
  const tests = (ranked) => {
    const count = ranked[0].length;
    const pairs = [];
    for (let a = 0; a < count; a += 1) for (let b = a + 1; b < count; b += 1) pairs.push([a, b]);
    const found = holm(pairs.map(([a, b]) => envlight.signedRank(
      ranked.map((line) => (line[a] === line[b] ? 0 : Math.log(line[a]) - Math.log(line[b]))))));
    const table = Array.from({ length: count }, () => new Array(count).fill(1));
    pairs.forEach(([a, b], k) => { table[a][b] = found[k]; table[b][a] = found[k]; });
    return table;
  };

  const everything = (data) => ({
    samplers: data.samplers.map(() => true), maps: data.maps.map(() => true), scenes: data.scenes.map(() => true),
  });

  // The ranking by a metric at a budget, over what is chosen: the best mean rank first.
  // chosen : whether each sampler, map and scene takes part; baseline : to whose error ratios are
  envlight.ranking = (data, name, metric, chosen = everything(data), baseline = "") => {
    const budget = data.budgets.find((found) => found.name === name);
    const fair = compared(data, budget, chosen);
    const metrics = [metric, ...Object.keys(budget.metrics).filter((other) => other !== metric)];
    const all = metrics.map((one) => tables(data, budget, one, fair));
    const means = all.map(({ ranks }) => fair.samplers.map((_, k) => mean(ranks.map((line) => line[k]))));
    const order = fair.samplers.map((_, k) => k).sort((a, b) => {
      for (const ranks of means) if (ranks[a] !== ranks[b] && ranks.length && !Number.isNaN(ranks[a])) return ranks[a] - ranks[b];
      return data.samplers[fair.samplers[a]] < data.samplers[fair.samplers[b]] ? -1 : 1;
    });
    const picked = (table) => table.map((line) => order.map((k) => line[k]));
    const [measured, ranked, ranks] = [all[0].measured, all[0].ranked, all[0].ranks].map(picked);
    const names = order.map((k) => data.samplers[fair.samplers[k]]);
    const found = { metric, budget: name, maps: ranked.length, cases: fair.cases.length, samplers: names };
    const wanted = [baseline, envlight.constants.baseline].find((one) => names.includes(one));
    const base = Math.max(0, names.indexOf(wanted));
    if (!ranked.length || !names.length) return { ...found, lines: [], baseline: "" };
    const positive = ranked.filter((line) => line.every((error) => error > 0 && Number.isFinite(error)));
    const ratio = positive.length ? ratios(positive.map((line) => line.map(Math.log)), base) : null;
    const p = tests(ranked);
    const rank = order.map((k) => means[0][k]);
    const count = (test) => ranked.filter((line, row) => test(line, row)).length;
    const lines = names.map((sampler, k) => ({
      sampler,
      index: fair.samplers[order[k]],
      place: 1 + rank.filter((other) => other < rank[k]).length,
      error: mean(measured.map((line) => line[k])),
      rank: rank[k],
      firsts: count((_, row) => ranks[row][k] === 1),
      shared: count((_, row) => ranks[row][k] === 1 && ranks[row].filter((other) => other === 1).length > 1),
      alike: k > 0 && p[0][k] > envlight.constants.level,
      ratio: ratio ? ratio[k].ratio : NaN, low: ratio ? ratio[k].low : NaN, high: ratio ? ratio[k].high : NaN,
      smaller: count((line) => line[k] < line[base]),
      equal: count((line) => line[k] === line[base]),
      larger: count((line) => line[k] > line[base]),
      p: p[base][k],
    }));
    return { ...found, lines, baseline: names[base] };
  };

  // Mean errors and costs at a budget, over the cases that the ranking is of.
  envlight.means = (data, name, metric, chosen = everything(data)) => {
    const budget = data.budgets.find((found) => found.name === name);
    const fair = compared(data, budget, chosen);
    const { maps, measured } = tables(data, budget, metric, fair);
    const cost = (kind, k) => {
      const values = fair.cases.map((place) => budget.costs[kind][place * data.samplers.length + k]);
      const known = values.filter((value) => !Number.isNaN(value));
      return known.length ? mean(known) : NaN;
    };
    const lines = fair.samplers.map((index, k) => ({
      sampler: data.samplers[index], index, error: mean(measured.map((line) => line[k])),
      lights: cost("lights", index), rays: cost("rays", index), seconds: cost("seconds", index),
    }));
    return { budget: name, lines: maps.length ? lines : [] };
  };
  envlight.everything = everything;
})();
