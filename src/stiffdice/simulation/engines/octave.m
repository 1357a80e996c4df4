% The cube of "Modeling and simulating dice", written down from the text: equations 1 to 10 and section 4.2.
% A request on standard input is a column of doubles, the answer on standard output the states asked for; no more input
% is the end.
%   request: how many states, steps between two of them, the numbers of `step` below, one state
%   state:   x_cm, u_cm, L, the nodes' angular velocity, and the eight nodes relative to the centre, 3 numbers each

1;

% What is killed leaves no file octave-workspace behind.
crash_dumps_octave_core (false);

% Equation 10: the weight of each node, and for those that the ground acts on its push and friction (section 4.2).
function F = forces (x, u, w, X, c)
  F = repmat ([0; 0; -c.weight], 1, 8);
  if (c.touches)
    U = repmat (u, 1, 8);                                      % equation 5, with w the cube's own if it turns
    if (c.turns)
      U = U + skew (w) * X;
    end
    depth = -(c.n' * (x + X));                                 % <-n, X_k>, with X_k from equation 4
    away = c.n' * U;                                           % <n, U_k>
    Fn = max (0, c.S * max (0, depth) - c.D * away);
    if (c.gated)
      Fn(depth <= 0) = 0;                                      % "any point that goes below the ground"
    end
    F = F + c.n * Fn;
    if (c.rubs)
      Utan = U - c.n * away;
      F = F - c.mu * Fn .* (Utan ./ (sqrt (sum (Utan .^ 2, 1)) + c.umin));
    end
  end
end

function M = skew (w)
  M = [0, -w(3), w(2); w(3), 0, -w(1); -w(2), w(1), 0];
end

% Equation 9.
function X = turned (X, w, dt)
  rate = norm (w);
  if (rate > 0)
    P = (w / rate) * (w / rate)';
    R = P + cos (rate * dt) * (eye (3) - P) + sin (rate * dt) * skew (w / rate);
    X = R * X;
  end
end

% Equations 6 to 9, in this order: each with what the one before it gave.
function [x, u, L, w, X] = step (x, u, L, w, X, c)
  F = forces (x, u, w, X, c);
  u = u + c.dt * sum (F, 2) / c.mass;
  x = x + c.dt * u;
  if (c.turns)
    torque = sum ([X(2,:) .* F(3,:) - X(3,:) .* F(2,:); X(3,:) .* F(1,:) - X(1,:) .* F(3,:); ...
                   X(1,:) .* F(2,:) - X(2,:) .* F(1,:)], 2);
    L = L + c.dt * torque;
    w = L / c.inertia;
    X = turned (X, w, c.dt);
  end
end

names = {"turns", "touches", "rubs", "gated", "dt", "mass", "inertia", "weight", "S", "D", "mu", "umin", "nx", "ny", "nz"};
while (true)
  request = fread (stdin, 2 + numel (names) + 36, "double");
  if (numel (request) < 2 + numel (names) + 36)
    break;
  end
  c = cell2struct (num2cell (request(3:end-36)), names, 1);
  c.n = [c.nx; c.ny; c.nz];
  s = request(end-35:end);
  x = s(1:3); u = s(4:6); L = s(7:9); w = s(10:12); X = reshape (s(13:36), 3, 8);
  states = zeros (36, request(1));
  for k = 1:request(1)
    for j = 1:request(2)
      [x, u, L, w, X] = step (x, u, L, w, X, c);
    end
    states(:, k) = [x; u; L; w; X(:)];
  end
  fwrite (stdout, states, "double");
  fflush (stdout);
end
