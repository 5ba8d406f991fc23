/* SPDX-License-Identifier: MIT */
/* Vectors of numbers, with one number for each of the cells that are computed at once, and the
 * functions that FFCx's kernels need; see simd_kernels.py. */

/* Vectors at any address of numbers, as NumPy allocates them. */
typedef double lanes __attribute__((vector_size(8 * LANES), aligned(8), may_alias));
typedef int64_t mask __attribute__((vector_size(8 * LANES), aligned(8), may_alias));
typedef uint64_t bits __attribute__((vector_size(8 * LANES), aligned(8), may_alias));

#define ALL(x) ((lanes){0} + (x))
#if LANES == 8
#define EACH(f) f(0), f(1), f(2), f(3), f(4), f(5), f(6), f(7)
#else
#define EACH(f) f(0), f(1), f(2), f(3)
#endif
#define PICK(m, a, b) ((lanes)(((m) & (mask)ALL(a)) | (~(m) & (mask)ALL(b))))

/* The polynomials of sine, cosine, exponential and logarithm come from fdlibm, k_sin.c, k_cos.c,
 * e_exp.c and e_log.c:
 *
 * Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved.
 *
 * Developed at SunSoft, a Sun Microsystems, Inc. business.
 * Permission to use, copy, modify, and distribute this
 * software is freely granted, provided that this notice
 * is preserved.
 */

/* sin(x + quarter π/2). The nearest multiple of π/2 is subtracted in three parts (Cody and Waite).
 * The polynomials are accurate to the last digit between -π/4 and π/4. The result loses digits for
 * x beyond 1e6, where x itself has few; x must stay below 1e15. */
static inline lanes trigonometric(lanes x, int64_t quarter)
{
  const lanes shifted = x * 0x1.45f306dc9c883p-1 + 0x1.8p52, k = shifted - 0x1.8p52;
  const mask n = (mask)shifted + quarter, odd = -(n & 1);
  lanes r = x - k * 0x1.921fb544p0;
  r -= k * 0x1.0b4611a6p-34;
  r -= k * 2.02226624879595063154e-21;
  const lanes z = r * r, half = z / 2, rest = 1 - half;
  const lanes sine = r + z * r *
    (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z *
    (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 + z *
    (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
  const lanes cosine = rest + (((1 - rest) - half) + z * z *
    (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z *
    (2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 + z *
    (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))))));
  return (lanes)((mask)PICK(odd, cosine, sine) ^ ((n & 2) << 62));
}

static inline lanes lanes_sin(lanes x) { return trigonometric(x, 0); }
static inline lanes lanes_cos(lanes x) { return trigonometric(x, 1); }
static inline lanes lanes_tan(lanes x) { return lanes_sin(x) / lanes_cos(x); }
static inline lanes lanes_fabs(lanes x) { return (lanes)((mask)x & INT64_MAX); }

/* exp(x), nearly always accurate to the last digit. The nearest multiple of log(2) is subtracted in
 * two parts. Two factors, because the power of two of the result may be out of the range of one. */
static inline lanes lanes_exp(lanes x)
{
  const lanes low = PICK(x < -760, ALL(-760), x), within = PICK(low > 720, ALL(720), low);
  const lanes k = (within * 0x1.71547652b82fep0 + 0x1.8p52) - 0x1.8p52;
  const lanes high = within - k * 6.93147180369123816490e-01, rest = k * 1.90821492927058770002e-10;
  const lanes r = high - rest, z = r * r;
  const lanes c = r - z * (1.66666666666666019037e-01 + z * (-2.77777777770155933842e-03 + z *
    (6.61375632143793436117e-05 + z * (-1.65339022054652515390e-06 + z *
    4.13813679705723846039e-08))));
  const lanes y = 1 - ((rest - r * c / (2 - c)) - high), half = (k / 2 + 0x1.8p52) - 0x1.8p52;
#define POWER_OF_TWO(n) ((lanes)((mask)((n) + (0x1.8p52 + 1023)) << 52))
  return y * POWER_OF_TWO(half) * POWER_OF_TWO(k - half);
#undef POWER_OF_TWO
}

/* log(x), nearly always accurate to the last digit: x is 2^k (1 + f), 1 + f next to 1. */
static inline lanes lanes_log(lanes x)
{
  const mask tiny = x < DBL_MIN, beyond = ~(x < INFINITY);
  const bits scaled = (bits)PICK(tiny, x * 0x1p54, x), above = scaled - 0x3fe6a09e667f3bcd;
  const bits exponent = (above + ((uint64_t)1023 << 52)) >> 52;
  const lanes near = (lanes)(exponent | (uint64_t)0x433LL << 52) - (0x1p52 + 1023);
  const lanes k = near - PICK(tiny, ALL(54), ALL(0));
  const lanes f = (lanes)(scaled - (above >> 52 << 52)) - 1, s = f / (2 + f), z = s * s;
  const lanes r = z * (6.666666666666735130e-01 + z * (3.999999999940941908e-01 + z *
    (2.857142874366239149e-01 + z * (2.222219843214978396e-01 + z * (1.818357216161805012e-01 + z *
    (1.531383769920937332e-01 + z * 1.479819860511658591e-01))))));
  const lanes half = f * f / 2;
  const lanes y = k * 6.93147180369123816490e-01 -
    ((half - (s * (half + r) + k * 1.90821492927058770002e-10)) - f);
  const lanes defined = PICK(x < 0, ALL(NAN), PICK(x == 0, ALL(-INFINITY), y));
  return PICK(beyond, x, defined);
}

/* x^y, with a relative error of about y log(x) last digits. */
static inline lanes lanes_power(lanes x, lanes y)
{
  lanes z = lanes_exp(y * lanes_log(x));
  for (int l = 0; l < LANES; ++l)
    if (!(x[l] > 0)) z[l] = pow(x[l], y[l]);
  return z;
}

static inline lanes lanes_sqrt(lanes x)
{
  for (int l = 0; l < LANES; ++l) x[l] = sqrt(x[l]);
  return x;
}

/* a / b from 1 / b, nearly always accurate to the last digit; a division takes as long as sixteen
 * products. The remainder must not be rounded: otherwise round-off would strain cells at rest. */
static inline lanes quotient(lanes a, lanes b, lanes over_b)
{
#ifdef __FP_FAST_FMA
  const lanes near = a * over_b;
  lanes rest;
  for (int l = 0; l < LANES; ++l) rest[l] = __builtin_fma(-near[l], b[l], a[l]);
  const lanes more = over_b * rest;
  return near + (lanes)((mask)more & (more - more == 0)); /* infinite numbers have no remainder */
#else
  return a / b;
#endif
}

static inline lanes lanes_pow(lanes x, int n)
{
  lanes y = ALL(1);
  for (int k = 0; k < (n < 0 ? -n : n); ++k) y *= x;
  if (n < 0) y = 1 / y;
  return y;
}
