% A throw by equations 4 to 10, node after node wherever the throw listing goes node after node, for its time alone.
% Standard input: the doubles read below; then one more that starts the steps. Standard output: ready; the place.

1;
sigterm_dumps_octave_core (false);                        % nothing of it is worth a file
sighup_dumps_octave_core (false);

function x = throw (steps, dt, S, D, mu, L, mass, side, gravity, umin)
  n = [0, 0, 1];
  s = side / 2;
  X = s * [1 1 1; 1 -1 1; -1 -1 1; -1 1 1; 1 1 -1; 1 -1 -1; -1 -1 -1; -1 1 -1];
  inertia = mass * side ^ 2 / 6 * eye (3);
  x = [0, 0, 3];
  u = [5, 0, 5];
  L = L(:);
  V = repmat (u, 8, 1);
  for step = 1:steps
    F = zeros (8, 3);
    F(:,3) = -mass / 8 * gravity;
    Z = repmat (x, 8, 1) + X;
    depth = max (0, -Z * n');
    away = V * n';
    push = max (0, S * depth - D * away);
    slip = V - away * n;
    speed = vecnorm (slip, 2, 2) + umin;
    F = F + push * n - mu * [push, push, push] .* (slip ./ [speed, speed, speed]);
    u = u + dt * sum (F, 1) / mass;
    x = x + dt * u;
    torque = zeros (3, 1);
    for k = 1:8
      torque = torque + cross (X(k,:), F(k,:))';
    end
    L = L + dt * torque;
    w = inertia \ L;
    a = w / norm (w);
    A = [0, -a(3), a(2); a(3), 0, -a(1); -a(2), a(1), 0];
    R = a * a' + cos (norm (w) * dt) * (eye (3) - a * a') + sin (norm (w) * dt) * A;
    for k = 1:8
      X(k,:) = (R * X(k,:)')';
    end
    turning = zeros (8, 3);
    for k = 1:8
      turning(k,:) = cross (w', X(k,:));
    end
    V = repmat (u, 8, 1) + turning;
  end
end

c = fread (stdin, 12, "double");
throw (10, c(2), c(3), c(4), c(5), c(6:8), c(9), c(10), c(11), c(12));
printf ("ready\n");
fflush (stdout);
fread (stdin, 1, "double");
printf ("%.17g %.17g %.17g\n", throw (c(1), c(2), c(3), c(4), c(5), c(6:8), c(9), c(10), c(11), c(12)));
