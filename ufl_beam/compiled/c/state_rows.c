/* SPDX-License-Identifier: MIT */
/* Rows of stored states; see state_rows.py. */

/* Write the state, or the entries of this process, into a row; see state_rows.py. */
void keep_state(const time_loop *m, double *row)
{
  memset(row, 0, m->sums * sizeof *row);
  for (int k = 0; k < m->num_groups; ++k) {
    const group_columns *n = m->groups + k;
    const double *from = *n->from;
    if (!n->to)
      memcpy(row + n->first, from, n->number * sizeof *row);
    else
      for (int i = 0; i < n->number; ++i) row[n->to[i]] += from[n->at[i]];
  }
}
